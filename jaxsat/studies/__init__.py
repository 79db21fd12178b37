"""Monte-Carlo studies: dispersions, designs, ensembles."""

from jaxsat.studies.designs import AbstractDesign, Independent, LatinHypercube, Sobol
from jaxsat.studies.dispersions import (
    Dispersed,
    Dispersions,
    StudyCase,
    number_at,
    with_gains,
    with_numbers,
)
from jaxsat.studies.distributions import (
    AbstractDistribution,
    Discrete,
    Normal,
    RandomAttitude,
    TruncatedNormal,
    Uniform,
)
from jaxsat.studies.ensemble import Study, StudyProgress, run_study
from jaxsat.studies.executors import AbstractExecutor, ClusterError, Devices, Serial, Threads
from jaxsat.studies.processes import Processes
from jaxsat.studies.quantities import QUANTITIES
from jaxsat.studies.recovery import FailureRecovery, Recovery
from jaxsat.studies.recovery_summary import (
    KindDiagnosis,
    KindRecovery,
    RecoverySummary,
    UnrecoveredCase,
    reason_words,
)
from jaxsat.studies.sensitivities import (
    Sensitivity,
    first_order_index,
    numbers_of,
    sensitivity,
)
from jaxsat.studies.statistics import (
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
from jaxsat.studies.summary import Summary, summarise
from jaxsat.studies.torques_left import TorquesLeft
from jaxsat.studies.work import Work, most_cases, study_work

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
