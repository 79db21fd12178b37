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
    percentile,
    wilson,
)
from jaxsat.montecarlo.summary import Summary, summarise
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
    "Independent",
    "Interval",
    "LatinHypercube",
    "Normal",
    "Processes",
    "RandomAttitude",
    "Sensitivity",
    "Serial",
    "Sobol",
    "StopRule",
    "Study",
    "StudyCase",
    "StudyProgress",
    "Summary",
    "Threads",
    "TruncatedNormal",
    "Uniform",
    "WhenDecided",
    "Work",
    "ends_text",
    "first_order_index",
    "most_cases",
    "number_at",
    "numbers_of",
    "percentile",
    "run_study",
    "sensitivity",
    "study_work",
    "summarise",
    "wilson",
    "with_gains",
    "with_numbers",
]
