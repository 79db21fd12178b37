"""Distributions of a `[dispersion]` table."""

import numpy as np

from jaxsat.core.checks import as_float
from jaxsat.scenario.dispersion_tables import PARAMETERS, DistributionTable
from jaxsat.studies.distributions import (
    AbstractProbabilityDistribution,
    Discrete,
    Normal,
    RandomAttitude,
    TruncatedNormal,
    Uniform,
)

_KINDS = {
    "uniform": Uniform,
    "normal": Normal,
    "truncated-normal": TruncatedNormal,
    "discrete": Discrete,
    "random-attitude": RandomAttitude,
}


def distribution_of(table: DistributionTable) -> AbstractProbabilityDistribution:
    """The distribution that a table describes; raises `ValueError` where it is none."""
    kind = table.distribution
    parameters = [as_float(np.asarray(getattr(table, name))) for name in PARAMETERS[kind]]
    return _KINDS[kind](*parameters)
