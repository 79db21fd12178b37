"""Outages of sensors: times without valid measurements, once or again and again."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import IntScalar, RealScalar
from jaxsat.core.checks import concrete
from jaxsat.core.errors import ArgumentError

SLACK = 1e-6
"""Time by which outages that come again begin and end early, in parts of the period: the remainder
of a time at which one begins may be rounded to just below the time between two."""

Times = Float[Array, " *sensors"] | None
"""A time (s) of one sensor, or of each of several; None for no outage, or no other one."""


def require_outage(start: Times, length: Times, every: Times) -> None:
    """Raise `ValueError` for an outage with only a start or only a length, for repetitions of
    none, and for those that leave no time between outages."""
    if (start is None) != (length is None):
        raise ValueError("Arguments `outage_start` and `outage` must be given together.")
    if every is None:
        return
    if length is None:
        raise ValueError("Argument `outage_every` must be given with `outage`.")
    period, duration = concrete(every), concrete(length)
    if period is not None and duration is not None and not (period > duration).all():
        raise ArgumentError("outage_every", "must be above `outage`", period.tolist())


def outside_outages(
    sample: IntScalar, period: RealScalar, start: Times, length: Times, every: Times
) -> Bool[Array, " *sensors"] | None:
    """Whether a sample is outside the outages of sensors, None for those without any.

    Samples are `period` s apart. An outage has this `length` (s) from `start` (s) on, and another
    one begins `every` s after each begin, None for a single one.
    """
    if start is None or length is None:
        return None
    since = sample * period - start
    if every is None:
        return (since < 0) | (since >= length)
    since = since + SLACK * period
    return (since < 0) | (jnp.mod(since, every) >= length)
