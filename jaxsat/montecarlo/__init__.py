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
from jaxsat.montecarlo.ensemble import Study, StudyProgress, require_counts, run_study
from jaxsat.montecarlo.executors import AbstractExecutor, ClusterError, Devices, Serial, Threads
from jaxsat.montecarlo.quantities import QUANTITIES
from jaxsat.montecarlo.statistics import (
    Interval,
    Sensitivity,
    StopRule,
    first_order_index,
    percentile,
    sensitivity,
    wilson,
)
from jaxsat.montecarlo.summary import Summary, summarise
from jaxsat.montecarlo.work import Work, most_cases, study_work

__all__ = [
    "QUANTITIES",
    "AbstractDesign",
    "AbstractDistribution",
    "AbstractExecutor",
    "ClusterError",
    "Devices",
    "Discrete",
    "Dispersed",
    "Dispersions",
    "Independent",
    "Interval",
    "LatinHypercube",
    "Normal",
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
    "Work",
    "first_order_index",
    "most_cases",
    "number_at",
    "percentile",
    "require_counts",
    "run_study",
    "sensitivity",
    "study_work",
    "summarise",
    "wilson",
    "with_gains",
    "with_numbers",
]
