"""What multiplicative Kalman filters of the attitude share: corrections by scalar measurements."""

from functools import partial
from typing import Any, NamedTuple, Protocol, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.control.navigation.estimator import (
    AbstractEstimator,
    Estimate,
    Measurement,
    difference,
    product,
    towards,
)
from jaxsat.control.navigation.innovation import InnovationRecord, InnovationTest
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.navigation_sensors import StarTracker


class Gains(NamedTuple):
    """E xy of a measured scalar y for the errors x of all estimates, that of the attitude first,
    and the inverse of the variance of y, zero without a measurement."""

    each: tuple[Float[Array, " _"], ...]
    scale: RealScalar


class Belief(Protocol):
    """Estimates at one sample, with the covariance of their errors.

    `q` is the attitude, a unit quaternion, scalar first; its error δ (rad, body axes) is that of
    the true attitude q ⊗ (1, δ/2).
    """

    q: Any

    def narrowed(
        self, axis: Vector, variance: RealScalar, valid: BoolScalar, *errors: int
    ) -> "tuple[Any, Gains]":
        """The belief with the covariance after a measurement along an axis with this variance, and
        its gains.

        δ is measured, or the sum of the `errors` with these numbers in the order of the gains.
        """
        ...

    def shifted(self, *changes: Float[Array, " _"]) -> Any:
        """The belief with these changes of its estimates, in the order of the gains."""
        ...


B = TypeVar("B", bound=Any)


class AbstractKalmanFilter(AbstractEstimator):
    """A multiplicative Kalman filter of star tracker and sensors of vectors.

    An attitude is processed as three scalar measurements about the star tracker's axes, a vector v
    as those of the rows of [v ×]: no matrix is inverted. `tracker` is the filter's
    model; `vector_noise` are the standard deviations of the sensors of vectors, in their units,
    and `vector_latency` is their latency in samples. With a `test` the filter leaves out what does
    not agree with its prediction. The memory has the field `record`, None without a test.
    """

    tracker: eqx.AbstractVar[StarTracker | None]
    vector_noise: eqx.AbstractVar[tuple[RealScalar, ...]]
    vector_latency: eqx.AbstractVar[int]
    test: eqx.AbstractVar[InnovationTest | None]

    @property
    def latency(self) -> int:
        """Number of samples until a measurement has arrived."""
        return max(self.vector_latency, 0 if self.tracker is None else self.tracker.latency)

    @property
    def attitude_sensors(self) -> int:
        """Number of the sensors of the attitude."""
        return len(self.vector_noise) + (self.tracker is not None)

    def first_record(self, like: Array, gyro: bool = False) -> InnovationRecord | None:
        """The record before the first reading, in `like`'s type; None without a test."""
        return None if self.test is None else self.test.init(self.attitude_sensors, like, gyro)

    def counts(self, memory: PyTree) -> dict[str, Float[Array, " sensors"]]:
        """Rejected readings and exclusions of each sensor; none without a test."""
        record = memory.record
        if record is None:
            return {}
        return {"rejected_readings": record.rejections, "sensor_exclusions": record.exclusions}

    def with_test(self, estimate: Estimate, record: InnovationRecord | None) -> Estimate:
        """The estimate with what the test knows of each sensor."""
        if self.test is None or record is None:
            return estimate
        excluded = self.test.excluded(record)
        return estimate._replace(innovation=record.innovation, excluded=excluded)

    def corrected(
        self, belief: B, measurement: Measurement, record: InnovationRecord | None
    ) -> tuple[B, InnovationRecord | None]:
        """The belief after the available measurements of attitude and vectors, and the record."""
        tracker, attitude, valid = self.tracker, measurement.attitude, measurement.seen
        sensor, test = 0, self.test
        if tracker is not None and attitude is not None and valid is not None:
            off = difference(Quaternion(belief.q), attitude)
            variances = tuple(sigma**2 for sigma in tracker.deviations)
            limit = None if test is None else test.attitude_threshold
            reading = (off, tracker.axes, variances, valid)
            belief, record = self.tested(belief, reading, record, sensor, limit)
            sensor += 1
        limit = None if test is None else test.vector_threshold
        for sigma, one in zip(self.vector_noise, measurement.vectors, strict=True):
            expected = Quaternion(belief.q).as_dcm().matrix @ one.reference
            rows = jnp.cross(jnp.eye(3, dtype=expected.dtype), expected[None])  # of [v x]
            off, variances = towards(expected, one.measured), (sigma**2,) * 3
            reading = (off, rows, variances, one.seen)
            belief, record = self.tested(belief, reading, record, sensor, limit)
            sensor += 1
        return belief, record

    def tested(
        self,
        belief: B,
        reading: tuple[Vector, Matrix, tuple[RealScalar, ...], BoolScalar],
        record: InnovationRecord | None,
        sensor: int,
        limit: RealScalar | None,
        *errors: int,
    ) -> tuple[B, InnovationRecord | None]:
        """The belief after a reading of a sensor, given as `_taken_in` takes it, if it passes."""
        after, square, white = _taken_in(belief, *reading, *errors)
        if self.test is None or record is None or limit is None:
            return after, record
        used, record = self.test.judged(record, sensor, square, limit, reading[-1], white)
        return jax.tree.map(partial(jnp.where, used), after, belief), record


def turned(
    q: Float[Array, "4"], turn: Quaternion, half: RealScalar, orbit: AbstractOrbit
) -> Float[Array, "4"]:
    """The attitude after the body's turn, with the orbit frame's own split around it.

    `half` (s) is half the time that it takes.
    """
    before = Quaternion(q)
    before = before.turned(-half * orbit.frame_rate(before))
    after = product(before, turn)
    return after.turned(-half * orbit.frame_rate(after)).q


@eqx.filter_jit
def corrected(
    estimator: AbstractKalmanFilter,
    belief: B,
    measurement: Measurement,
    record: InnovationRecord | None,
) -> tuple[B, InnovationRecord | None]:
    """What `estimator.corrected` returns, as a function of its own in compiled programs."""
    return estimator.corrected(belief, measurement, record)


def _taken_in(
    belief: B,
    off: Vector,
    axes: Matrix,
    variances: tuple[RealScalar, ...],
    valid: BoolScalar,
    *errors: int,
) -> tuple[B, RealScalar, Vector | None]:
    """The belief after measurement of a small rotation (rad) by its components along `axes`.

    Each has a variance, in (rad times the length of its axis)². The second result is the normalised
    square of the innovation: the sum of those of the components, each given the ones before. With
    `errors`, their sum is measured in place of the rotation, see `Belief.narrowed`; the third
    result are then these components as numbers of unit variance.
    """
    changes, square, white = None, jnp.zeros_like(off[0]), []
    for axis, variance in zip(axes, variances, strict=True):
        belief, (each, scale) = belief.narrowed(axis, variance, valid, *errors)
        if changes is None:
            changes = tuple(jnp.zeros_like(one) for one in each)
        first, *others = (changes[one] for one in errors or (0,))
        innovation = axis @ (off - sum(others, first))
        surprise = scale * innovation
        square = square + surprise * innovation
        white.append((innovation, scale))
        changes = tuple(old + surprise * one for old, one in zip(changes, each, strict=True))
    after = belief.shifted(*(changes or ()))
    if not errors:
        return after, square, None
    innovations, scales = map(jnp.stack, zip(*white, strict=True))
    return after, square, innovations * jnp.sqrt(jnp.where(valid, scales, 1.0))
