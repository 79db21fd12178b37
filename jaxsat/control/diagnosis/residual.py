"""Innovations of Kalman filters of measurements, and signatures of failures in them.

Differences of readings have correlated noise; innovations do not, and the filter's gain says how
the signature of a failure decays in them. A kind of actuator has one filter: of the body's rate, in
which all actuators leave their signatures, or of its telemetry, in which each leaves its own.
"""

import abc
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control.diagnosis.isolation import Hypotheses, Residual
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.spacecraft.wheels import Wheels

RESTLESSNESS = 0.25
"""Process noise over measurement noise; a signature decays by 0.39 a sample."""

TEST_SIGMAS = 6.0
"""Effect of a test pulse on a measurement, over its noise."""

TRACKING = 0.1
"""Fraction of the error of a flow that is corrected at each sample."""


DOUBTED_SIGMAS, BELIEVED_SIGMAS = 2.0, 4.0
"""Sigmas of an estimate below which it is ignored, and above which it is used."""


def believed(squares: RealScalar) -> RealScalar:
    """Return the part of an estimate that is used, by the sum of squares over its variances."""
    some = squares > 0  # the square root has no derivative at zero
    sigmas = jnp.where(some, jnp.sqrt(jnp.where(some, squares, 1.0)), 0.0)
    return jnp.clip((sigmas - DOUBTED_SIGMAS) / (BELIEVED_SIGMAS - DOUBTED_SIGMAS), 0.0, 1.0)


class Reading(NamedTuple):
    """Measured rate of the body (rad/s), and `momentum` of wheels by tachometers (N m s) or None.

    `unwatched` is the mean torque (N m) since the last reading of actuators which no filter
    watches, None without them.
    """

    rate: Vector
    momentum: Float[Array, " wheels"] | None = None
    unwatched: Vector | None = None


def momentum_with_rotors(wheels: Wheels, reading: Reading) -> Float[Array, " wheels"]:
    """Return h + J_w aᵀω (N m s), which motor and friction alone change; with the momentum of the
    body without rotors it is the total. Raises `ValueError` for a reading without momenta."""
    if reading.momentum is None:
        raise ValueError("Argument `reading` must have the momenta of wheels, but has none.")
    if wheels.rotor_inertia is None:
        return reading.momentum
    return reading.momentum + wheels.rotor_inertia * (wheels.axes.T @ reading.rate)


class ActuatorCondition(NamedTuple):
    """Estimated condition of each actuator: whether it has `failed`, and the torque that it makes.

    `part` is the fraction of its command, `flow` the fraction of full torque that it makes all the
    time (for a wheel: friction). `torque` (N m) is constant besides: external, or an error of those
    that oppose a flow; it is estimated from as many `samples`.
    """

    failed: Bool[Array, " m"]
    part: Float[Array, " m"]
    flow: Float[Array, " m"]
    torque: Vector
    samples: RealScalar

    @staticmethod
    def sound(count: int) -> "ActuatorCondition":
        """Return the condition of actuators that all work, without external torque."""
        zero = jnp.zeros(count)
        return ActuatorCondition(zero > 0, zero + 1, zero, jnp.zeros(3), jnp.array(0.0))


class FilterMemory(NamedTuple):
    """Filtered measurements, their variance, and each actuator's signatures, as in a `Residual`.

    `own` is further memory of one kind of filter. `started` is false before the first valid
    reading.
    """

    estimate: Float[Array, "n k"]
    variance: Float[Array, " k"]
    loss: Float[Array, "n m"]
    flow: Float[Array, "n m"]
    errors: Float[Array, "numbers n k"]
    steady: RealScalar | None
    started: BoolScalar
    own: PyTree


class Prediction(NamedTuple):
    """Change of an estimate in a period, and what a failure would have left in it.

    `squares` is the sum of squares of changes by torques, `errors` the changes by each number of
    the model, torque or moment of inertia, over its relative error. Variances are `doubt`, of the
    change besides errors of these torques, and `passing`, one in the innovation that does not stay
    in the estimate. `loss`, `flow` and `steady` are added to the signatures in a period, and
    `driven` is as in `Residual`. `own` maps the residual, and the fraction of it that stays, to the
    filter's own memory.
    """

    change: Float[Array, "n k"]
    squares: RealScalar | Float[Array, " k"]
    errors: Float[Array, "numbers n k"]
    loss: Float[Array, "n m"]
    flow: Float[Array, "n m"]
    own: Callable[[Residual, Float[Array, " k"]], PyTree]
    steady: RealScalar | None = None
    doubt: RealScalar | Float[Array, " k"] | float = 0.0
    passing: RealScalar | float = 0.0
    driven: Float[Array, " m"] | None = None


class AbstractResidualFilter(eqx.Module):
    """A Kalman filter of measurements with the signatures of actuator failures in them.

    Each column has a variance of its own, and noise of one standard deviation.
    """

    hypotheses: ClassVar[Hypotheses]
    """Failure hypotheses of an actuator of the kind."""

    restarts_at_losses: ClassVar[bool]
    """Whether the filter restarts at an alarm for a loss, not for a flow alone."""

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """Number of actuators."""

    @property
    @abc.abstractmethod
    def noise(self) -> Float[Array, " k"]:
        """Standard deviation of each column's measurement noise."""

    @abc.abstractmethod
    def read(self, reading: Reading) -> Float[Array, "n k"]:
        """Return the part of a reading that is filtered."""

    @abc.abstractmethod
    def init(self, reading: Reading) -> FilterMemory:
        """Return the memory at the first reading."""

    @abc.abstractmethod
    def predicted(
        self,
        reading: Reading,
        commanded: Float[Array, " m"],
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
    ) -> Prediction:
        """Predict the change in the period (s) that ends with a reading."""

    def step(
        self,
        reading: Reading,
        commanded: Float[Array, " m"],
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
        uncertainty: RealScalar,
    ) -> tuple[Residual, FilterMemory]:
        """Return the residual of the period (s) that ends with a reading, and the next memory.

        `commanded` are the commands in that period. Torques are assumed to be wrong by the fraction
        `uncertainty`.
        """
        measurement, started, noise = self.read(reading), memory.started, self.noise**2
        ahead = self.predicted(reading, commanded, condition, period, memory)
        doubt = uncertainty**2 * ahead.squares + ahead.doubt
        predicted = memory.variance + RESTLESSNESS * noise + doubt
        variance = predicted + noise
        gain = jnp.where(started, predicted / variance, 1.0)
        left = 1 - gain
        innovation = jnp.where(started, measurement - memory.estimate - ahead.change, 0.0)
        steady = None
        if memory.steady is not None and ahead.steady is not None:
            steady = jnp.where(started, memory.steady + ahead.steady, 0.0)
        residual = Residual(
            innovation,
            variance + ahead.passing,
            jnp.where(started, memory.loss + ahead.loss, 0.0),
            jnp.where(started, memory.flow + ahead.flow, 0.0),
            jnp.where(started, memory.errors + uncertainty * ahead.errors, 0.0),
            steady,
            ahead.driven,
        )
        after = memory.estimate + ahead.change + gain[None] * innovation
        following = FilterMemory(
            jnp.where(started, after, measurement),
            jnp.where(started, left * predicted, noise),
            left[None] * residual.loss,
            left[None] * residual.flow,
            left[None, None] * residual.errors,
            None if steady is None else left[0] * steady,
            jnp.array(True),
            ahead.own(residual, left),
        )
        return residual, following

    @abc.abstractmethod
    def tracked(
        self,
        residual: Residual,
        condition: ActuatorCondition,
        period: RealScalar,
        quiet: BoolScalar,
    ) -> ActuatorCondition:
        """Correct the flows that actuators make all the time, and the external torque.

        The latter is corrected only while it is `quiet`: nothing is suspected.
        """

    @abc.abstractmethod
    def test_command(self, period: RealScalar, sigma: Float[Array, " k"]) -> Float[Array, " m"]:
        """Return commands of test pulses that stand out of errors of this standard deviation."""

    def torque_of(self, acceleration: Vector) -> Vector:
        """Return the torque (N m) of an acceleration (rad/s²); zero for telemetry on board."""
        return jnp.zeros_like(acceleration)

    def named(self, kind: IntScalar, actuator: IntScalar, memory: FilterMemory) -> IntScalar:
        """Return the kind of a verdict; by default as isolated."""
        return kind
