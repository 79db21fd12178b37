"""Test of a filter's innovations: single readings are rejected, and persistently bad sensors
excluded."""

import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.core.checks import as_float, require_counts
from jaxsat.core.errors import ArgumentError

ATTITUDE_DEGREES, VECTOR_DEGREES = 3, 2
"""Degrees of freedom of the innovation of an attitude, and of a vector: a turn about it is not
measured."""


class InnovationRecord(NamedTuple):
    """What the test knows of each of m sensors: how many of its last readings were rejected in a
    row, and the `innovation` of the last one over the threshold."""

    rejected: Float[Array, " m"]
    innovation: Float[Array, " m"]


class InnovationTest(eqx.Module):
    """A χ² test of the innovation ν of each reading: νᵀS⁻¹ν, S being the covariance of ν.

    A good reading is rejected with the false-alarm probability, for which `attitude_threshold` and
    `vector_threshold` are the thresholds of attitudes and vectors (Bar-Shalom, Li and Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, section 5.4). A sensor of which
    `patience` readings in a row are rejected is excluded for good.

    Raises `ArgumentError` for a probability that is not between 0 and 1 or a `patience` below 1.
    """

    attitude_threshold: RealScalar
    vector_threshold: RealScalar
    patience: int = eqx.field(static=True)

    def __init__(self, false_alarm_probability: float, patience: int):
        if not 0 < false_alarm_probability < 1:
            rule = "must be between 0 and 1"
            raise ArgumentError("false_alarm_probability", rule, false_alarm_probability)
        require_counts(patience=patience)
        self.attitude_threshold = as_float(threshold(false_alarm_probability, ATTITUDE_DEGREES))
        self.vector_threshold = as_float(threshold(false_alarm_probability, VECTOR_DEGREES))
        self.patience = patience

    def init(self, sensors: int, like: Array) -> InnovationRecord:
        """Return the record of so many sensors before their first readings, in `like`'s type."""
        zeros = jnp.zeros(sensors, like.dtype)
        return InnovationRecord(zeros, zeros)

    def excluded(self, record: InnovationRecord) -> Float[Array, " m"]:
        """Return 1 for each sensor that is excluded, 0 for the others."""
        return jnp.where(record.rejected >= self.patience, 1.0, 0.0)

    def judged(
        self,
        record: InnovationRecord,
        sensor: int,
        square: RealScalar,
        limit: RealScalar,
        seen: BoolScalar,
    ) -> tuple[BoolScalar, InnovationRecord]:
        """Return whether a reading is used, and the record after it.

        `square` is its νᵀS⁻¹ν, to be at most `limit`; there is no reading where it is not `seen`.
        """
        count = record.rejected[sensor]
        present = count < self.patience
        good = square <= limit
        rejected = jnp.where(seen & present, jnp.where(good, 0.0, count + 1), count)
        innovation = jnp.where(seen, square / limit, record.innovation[sensor])
        mine = jnp.arange(record.rejected.shape[0]) == sensor
        return seen & present & good, InnovationRecord(
            jnp.where(mine, rejected, record.rejected),
            jnp.where(mine, innovation, record.innovation),
        )


def threshold(probability: float, degrees: int) -> float:
    """Return the number that a χ² variable of 2 or 3 `degrees` exceeds with a probability."""
    if degrees == VECTOR_DEGREES:
        return -2 * math.log(probability)

    def exceeds(square: float) -> float:
        root = math.sqrt(square / 2)
        return math.erfc(root) + 2 * root / math.sqrt(math.pi) * math.exp(-square / 2)

    low, high = 0.0, 1500.0
    while (middle := (low + high) / 2) not in (low, high):
        low, high = (middle, high) if exceeds(middle) > probability else (low, middle)
    return middle
