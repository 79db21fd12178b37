"""Monte-Carlo studies: dispersions, designs, ensembles."""

from jaxsat.montecarlo.designs import AbstractDesign, Independent, LatinHypercube, Sobol
from jaxsat.montecarlo.dispersions import (
    Dispersed,
    Dispersions,
    StudyCase,
    number_at,
    with_gains,
    with_numbers,
)
from jaxsat.montecarlo.distributions import (
    AbstractDistribution,
    Discrete,
    Normal,
    RandomAttitude,
    TruncatedNormal,
    Uniform,
)
from jaxsat.montecarlo.ensemble import Study, StudyProgress, run_study
from jaxsat.montecarlo.executors import AbstractExecutor, ClusterError, Devices, Serial, Threads
from jaxsat.montecarlo.processes import Processes
from jaxsat.montecarlo.quantities import QUANTITIES
from jaxsat.montecarlo.recovery import FailureRecovery, Recovery
from jaxsat.montecarlo.recovery_summary import (
    KindDiagnosis,
    KindRecovery,
    RecoverySummary,
    UnrecoveredCase,
    reason_words,
)
from jaxsat.montecarlo.sensitivities import (
    Sensitivity,
    first_order_index,
    numbers_of,
    sensitivity,
)
from jaxsat.montecarlo.statistics import (
    LEVEL,
    AbstractStopRule,
    Interval,
    StopRule,
    WhenDecided,
    ends_text,
    fraction_text,
    percent_texts,
    percentile,
    wilson,
)
from jaxsat.montecarlo.summary import Summary, summarise
from jaxsat.montecarlo.torques_left import TorquesLeft
from jaxsat.montecarlo.work import Work, most_cases, study_work

__all__ = [
    "LEVEL",
    "QUANTITIES",
    "AbstractDesign",
    "AbstractDistribution",
    "AbstractExecutor",
    "AbstractStopRule",
    "ClusterError",
    "Devices",
    "Discrete",
    "Dispersed",
    "Dispersions",
    "FailureRecovery",
    "Independent",
    "Interval",
    "KindDiagnosis",
    "KindRecovery",
    "LatinHypercube",
    "Normal",
    "Processes",
    "RandomAttitude",
    "Recovery",
    "RecoverySummary",
    "Sensitivity",
    "Serial",
    "Sobol",
    "StopRule",
    "Study",
    "StudyCase",
    "StudyProgress",
    "Summary",
    "Threads",
    "TorquesLeft",
    "TruncatedNormal",
    "Uniform",
    "UnrecoveredCase",
    "WhenDecided",
    "Work",
    "ends_text",
    "first_order_index",
    "fraction_text",
    "most_cases",
    "number_at",
    "numbers_of",
    "percent_texts",
    "percentile",
    "reason_words",
    "run_study",
    "sensitivity",
    "study_work",
    "summarise",
    "wilson",
    "with_gains",
    "with_numbers",
]
