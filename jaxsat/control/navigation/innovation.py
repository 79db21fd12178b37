"""Test of a filter's innovations: single readings are rejected, and persistently bad sensors
excluded."""

import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.checks import as_float, require_counts
from jaxsat.core.declaration.sensors import PATIENCE, PROBATION
from jaxsat.core.errors import ArgumentError

ATTITUDE_DEGREES, VECTOR_DEGREES = 3, 2
"""Degrees of freedom of the innovation of an attitude, and of a vector: a turn about it is not
measured."""


MEMORY = 0.01
"""Weight of the last reading of a gyro in the mean of its innovations."""


class InnovationRecord(NamedTuple):
    """What the test knows of each of m sensors.

    `streak` counts its last readings that were rejected in a row, up to `patience`; of an excluded
    sensor also those since then that agreed in a row. `innovation` is that of the last reading over
    the threshold. `rejections` are the readings that did not agree while it was used, and
    `exclusions` how often it was excluded, both since the start. `mean` is that of the innovations
    of a gyro, the last sensor, in parts of their standard deviations; None without one.
    """

    streak: Float[Array, " m"]
    innovation: Float[Array, " m"]
    rejections: Float[Array, " m"]
    exclusions: Float[Array, " m"]
    mean: Vector | None = None


class InnovationTest(eqx.Module):
    """A χ² test of the innovation ν of each reading: νᵀS⁻¹ν, S being the covariance of ν.

    A good reading is rejected with the false-alarm probability, for which `attitude_threshold` and
    `vector_threshold` are the thresholds of attitudes and vectors (Bar-Shalom, Li and Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, section 5.4). A sensor of which
    `patience` readings in a row are rejected is excluded: its readings are tested, not used. After
    `probation` readings in a row that pass it is used again.

    A gyro measures so often that errors of the size of its noise, which pass, soon matter. So the
    mean of its innovations while it is used, which are white, is tested in the same way: with the
    weight a of the last one, its covariance is a/(2 - a) of theirs.

    Raises `ArgumentError` for a probability that is not between 0 and 1, and for a `patience` or a
    `probation` below 1.
    """

    attitude_threshold: RealScalar
    vector_threshold: RealScalar
    patience: int = eqx.field(static=True)
    probation: int = eqx.field(static=True)

    def __init__(
        self,
        false_alarm_probability: float,
        patience: int = PATIENCE,
        probation: int = PROBATION,
    ):
        if not 0 < false_alarm_probability < 1:
            rule = "must be between 0 and 1"
            raise ArgumentError("false_alarm_probability", rule, false_alarm_probability)
        require_counts(patience=patience, probation=probation)
        self.attitude_threshold = as_float(threshold(false_alarm_probability, ATTITUDE_DEGREES))
        self.vector_threshold = as_float(threshold(false_alarm_probability, VECTOR_DEGREES))
        self.patience, self.probation = patience, probation

    def init(self, sensors: int, like: Array, gyro: bool = False) -> InnovationRecord:
        """The record of so many sensors, and a gyro, before any reading, of `like`'s type."""
        mean = jnp.zeros(3, like.dtype) if gyro else None
        return InnovationRecord(*[jnp.zeros(sensors + gyro, like.dtype)] * 4, mean=mean)

    def excluded(self, record: InnovationRecord) -> Float[Array, " m"]:
        """Return 1 for each sensor that is excluded, 0 for the others."""
        return jnp.where(record.streak >= self.patience, 1.0, 0.0)

    def judged(
        self,
        record: InnovationRecord,
        sensor: int,
        square: RealScalar,
        limit: RealScalar,
        valid: BoolScalar,
        white: Vector | None = None,
    ) -> tuple[BoolScalar, InnovationRecord]:
        """Return whether a reading is used, and the record after it.

        `square` is its νᵀS⁻¹ν, to be at most `limit`; there is no reading where it is not `valid`.
        For a gyro its innovation is given as `white` numbers of unit variance.
        """
        mean = record.mean
        if mean is not None and white is not None:
            counts = valid & (square <= limit)
            mean = jnp.where(counts, (1 - MEMORY) * mean + MEMORY * white, mean)
            square = jnp.maximum(square, (2 - MEMORY) / MEMORY * jnp.sum(mean**2))
        before = record.streak[sensor]
        present, good = before < self.patience, square <= limit
        streak = jnp.where(good == present, jnp.where(present, 0.0, self.patience), before + 1)
        streak = jnp.where(streak >= self.patience + self.probation, 0.0, streak)
        mine = (jnp.arange(record.streak.shape[0]) == sensor) & valid
        rejected = jnp.where(present & ~good, 1.0, 0.0)
        begins = jnp.where(present & (streak >= self.patience), 1.0, 0.0)
        if mean is not None and white is not None:
            mean = jnp.where(present & (streak < self.patience), mean, 0.0)
        return valid & present & good, InnovationRecord(
            jnp.where(mine, streak, record.streak),
            jnp.where(mine, square / limit, record.innovation),
            jnp.where(mine, record.rejections + rejected, record.rejections),
            jnp.where(mine, record.exclusions + begins, record.exclusions),
            mean,
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
