"""Interface of attitude estimators, and the body rotations that they use."""

import abc
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.trigonometry import cos, sin
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.vector_sensors import Observation, VectorSensor


def rotation(angle: Vector) -> Quaternion:
    """The rotation of the body by a rotation vector, rad."""
    square = jnp.sum(angle**2) / 4
    turns = square > 0
    half = jnp.sqrt(jnp.where(turns, square, 1.0))
    share = jnp.where(turns, sin(half) / half, 1.0)
    return Quaternion(jnp.concatenate([jnp.where(turns, cos(half), 1.0)[None], share / 2 * angle]))


def product(q: Quaternion, turn: Quaternion) -> Quaternion:
    """q ⊗ p: the attitude q, then the body rotation p."""
    return Quaternion(turn.q[0] * q.q + 2 * q.rate(turn.q[1:]).q)


def between(q: Quaternion, p: Quaternion) -> Quaternion:
    """The body rotation from the attitude q to the attitude p, at most half a circle."""
    turn = product(Quaternion(q.q * jnp.array([1.0, -1.0, -1.0, -1.0])), p).q
    return Quaternion(jnp.where(turn[0] < 0, -turn, turn))


def difference(q: Quaternion, p: Quaternion) -> Vector:
    """The small rotation (rad) with which `q.turned` gives p, the rotation vector to second order.

    2 tan(θ/2) in place of θ corrects a large rotation in one step; bounded near half a circle.
    """
    turn = between(q, p).q
    return 2 * turn[1:] / jnp.maximum(turn[0], 0.01)


def rotation_vector(q: Quaternion, p: Quaternion) -> Vector:
    """The rotation vector (rad) of the turn from the attitude q to p, at most half a circle."""
    turn = between(q, p).q
    square = jnp.sum(turn[1:] ** 2)
    turns = square > 0
    size = jnp.sqrt(jnp.where(turns, square, 1.0))
    return turn[1:] * jnp.where(turns, 2 * jnp.arctan2(size, turn[0]) / size, 2.0)


def towards(expected: Vector, measured: Vector) -> Vector:
    """The small rotation of the body (rad) across a vector that moves its expected to its measured
    direction in body axes.

    2 tan(θ/2) in place of the angle θ between both, as in `difference`; bounded near half a circle.
    """
    size = jnp.sqrt(jnp.sum(expected**2) * jnp.sum(measured**2))
    return 2 * jnp.cross(measured, expected) / jnp.maximum(size + expected @ measured, 0.01 * size)


class Measurement(NamedTuple):
    """Measurements that arrive at one sample: the present rate (rad/s), and an attitude.

    The attitude is older by the latency of the sensors; there is none where `seen` is false.
    Without a star tracker both are None. `vectors` are the simultaneous measurements of the
    sensors of vectors: magnetometer, Sun sensor, horizon sensor and those of packages, in this
    order, without absent ones.

    Without a gyro `rate` is None. For an estimator that knows the body, `valid` is whether the rate
    is valid, None for always; `torque` (N m, body axes) is the mean of what thrusters and
    magnetorquers were commanded since the last sample, and `momentum` (N m s, body axes) what
    tachometers and gimbals measure now of the momentum relative to the body, None where no device
    stores any.
    """

    rate: Vector | None
    attitude: Quaternion | None
    seen: BoolScalar | None
    vectors: tuple[Observation, ...] = ()
    torque: Vector | None = None
    momentum: Vector | None = None
    valid: BoolScalar | None = None


class Estimate(NamedTuple):
    """Estimate at one sample, in body axes.

    The attitude is relative to the orbit frame, `omega` the inertial rate (rad/s), `bias` that of
    the gyro (rad/s). The sigmas are the computed standard deviations of the errors of attitude
    (rad), rate and bias (rad/s) about each axis. For the star tracker, each sensor of a
    vector and a gyro that is tested, in the order of a measurement, `innovation` is the normalised
    square of the innovation of the last reading, over the threshold above which it is rejected, and
    `excluded` 1 for a sensor that is excluded, else 0. None marks values that are not estimated.
    """

    attitude: Quaternion
    omega: Vector
    bias: Vector | None = None
    attitude_sigma: Vector | None = None
    rate_sigma: Vector | None = None
    bias_sigma: Vector | None = None
    innovation: Float[Array, " sensors"] | None = None
    excluded: Float[Array, " sensors"] | None = None


class EstimatorContext(NamedTuple):
    """Data from a scenario for an estimator besides its own keys: the sensors as declared, the
    orbit, and the sample period (s).

    `tracker` is None without a star tracker; `vectors` are the sensors of vectors, in the
    order of a measurement. Without a gyro `gyro` is None, and `body` is the
    declared spacecraft with its actuators as they are without failures.
    """

    gyro: Gyro | None
    tracker: StarTracker | None
    orbit: AbstractOrbit
    period: RealScalar
    vectors: tuple[VectorSensor, ...] = ()
    body: RigidBody | None = None

    @property
    def latency(self) -> int:
        """Number of samples until the measurements of all attitude sensors have arrived."""
        return latency_of(self.tracker, self.vectors)


def latency_of(tracker: StarTracker | None, vectors: Sequence[VectorSensor]) -> int:
    """The latency of the slowest of these sensors, in samples."""
    return max(one.latency for one in (tracker, *vectors) if one is not None)


class AbstractEstimator(eqx.Module):
    """Estimator: the measurements of a run, one sample after the other, to estimates.

    Estimators that a scenario can name also have a `declaration`, a `PartDeclaration`, and a class
    method `from_table(values, context)`: `values` has every declared key, `context` is an
    `EstimatorContext`.
    """

    @abc.abstractmethod
    def init(self, attitude: Quaternion, sigma: RealScalar) -> PyTree:
        """The memory before the first sample.

        `attitude` is the first estimate; its error has the standard deviation `sigma` (rad) about
        each axis.
        """

    @abc.abstractmethod
    def step(
        self, sample: IntScalar, period: RealScalar, measurement: Measurement, memory: PyTree
    ) -> tuple[Estimate, PyTree]:
        """The estimate at a sample of the run, and the memory; samples are `period` s apart."""

    def counts(self, memory: PyTree) -> dict[str, Float[Array, " sensors"]]:
        """What a memory has counted of each attitude sensor, by its column of a study."""
        return {}


class RawMeasurements(AbstractEstimator):
    """No estimator: the measured rate, and the last attitude of the star tracker."""

    def init(self, attitude: Quaternion, sigma: RealScalar) -> Quaternion:
        """The first estimate, used until the first measurement."""
        return attitude

    def step(
        self, sample: IntScalar, period: RealScalar, measurement: Measurement, memory: Quaternion
    ) -> tuple[Estimate, Quaternion]:
        """The measurement as an estimate; vectors are ignored. There must be a rate."""
        assert measurement.rate is not None
        if measurement.attitude is None or measurement.seen is None:
            return Estimate(memory, measurement.rate), memory
        q = jnp.where(measurement.seen, measurement.attitude.q, memory.q)
        return Estimate(Quaternion(q), measurement.rate), Quaternion(q)
