"""What is read and was not commanded: innovations of Kalman filters, and failures in them.

Differences of readings have correlated noise; the innovations of a Kalman filter of what is read do
not. The filter's gain also says how the signature of a failure decays in them. A kind of actuator
has one filter: of the body's rate, in which all actuators leave their signatures, or of telemetry
of its own, in which each leaves its own.
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
"""Process noise over the noise of what is read, so that a signature decays by 0.39 a sample."""

TEST_SIGMAS = 6.0
"""Effect of a test pulse on what is read, over its noise."""

TRACKING = 0.1
"""Part of the error of a flow that is taken out with each sample."""


class Reading(NamedTuple):
    """The rate of the body (rad/s), and what tachometers measure of wheels (N m s), None without.

    `unwatched` is the torque (N m) that actuators which no filter watches are believed to have made
    on average since the last reading, None without them.
    """

    rate: Vector
    momentum: Float[Array, " wheels"] | None = None
    unwatched: Vector | None = None


def momentum_with_rotors(wheels: Wheels, reading: Reading) -> Float[Array, " wheels"]:
    """h + J_w aᵀω (N m s): with the inertia of the body without rotors it makes up the total
    momentum, and motor and friction alone change it. Raises `ValueError` for a reading without.
    """
    if reading.momentum is None:
        raise ValueError("Argument `reading` must have the momenta of wheels, but has none.")
    if wheels.rotor_inertia is None:
        return reading.momentum
    return reading.momentum + wheels.rotor_inertia * (wheels.axes.T @ reading.rate)


class ActuatorCondition(NamedTuple):
    """What is believed of each actuator: whether it has `failed`, and what it makes.

    The part `part` of what is commanded, and the part `flow` of full torque all the time, which is
    what brakes a wheel. `torque` (N m) is what acts besides all the time: on the spacecraft from
    outside, and where others oppose a flow and make not quite what they should. As many `samples`
    tell of it.
    """

    failed: Bool[Array, " m"]
    part: Float[Array, " m"]
    flow: Float[Array, " m"]
    torque: Vector
    samples: RealScalar

    @staticmethod
    def sound(count: int) -> "ActuatorCondition":
        """All work, and nothing is known to act besides."""
        zero = jnp.zeros(count)
        return ActuatorCondition(zero > 0, zero + 1, zero, jnp.zeros(3), jnp.array(0.0))


class FilterMemory(NamedTuple):
    """What is filtered, its variance, and each actuator's signatures in it, as in a `Residual`.

    `own` is what one kind of filter remembers besides. `started` is false before the first reading
    that counts.
    """

    estimate: Float[Array, "n k"]
    variance: Float[Array, " k"]
    loss: Float[Array, "n m"]
    flow: Float[Array, "n m"]
    steady: RealScalar | None
    started: BoolScalar
    own: PyTree


class Prediction(NamedTuple):
    """How an estimate changes in a period, and what a failure would have left in it.

    `squares` is the sum of squares of what torques are believed to have changed. Variances are
    `doubt`, of the change besides errors of these torques, and `passing`, one that is in the
    innovation and does not stay in the estimate. `loss`, `flow` and `steady` are what a period adds
    to the signatures, and `driven` is as in `Residual`. `own` makes of the residual, of which a
    part stays, what the filter remembers of its own.
    """

    change: Float[Array, "n k"]
    squares: RealScalar | Float[Array, " k"]
    loss: Float[Array, "n m"]
    flow: Float[Array, "n m"]
    own: Callable[[Residual, Float[Array, " k"]], PyTree]
    steady: RealScalar | None = None
    doubt: RealScalar | Float[Array, " k"] | float = 0.0
    passing: RealScalar | float = 0.0
    driven: Float[Array, " m"] | None = None


class AbstractResidualFilter(eqx.Module):
    """A Kalman filter of what is read, which knows what a failure of an actuator leaves in it.

    The filters of all columns that are read have variances of their own, and noise of one standard
    deviation each.
    """

    hypotheses: ClassVar[Hypotheses]
    """What may have happened to an actuator of the kind."""

    restarts_at_losses: ClassVar[bool]
    """Whether the filter starts anew at an alarm for a loss, too, and not for a flow alone."""

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """How many actuators there are."""

    @property
    @abc.abstractmethod
    def noise(self) -> Float[Array, " k"]:
        """Standard deviation of what is read, of each column."""

    @abc.abstractmethod
    def read(self, reading: Reading) -> Float[Array, "n k"]:
        """What of a reading is filtered."""

    @abc.abstractmethod
    def init(self, reading: Reading) -> FilterMemory:
        """The memory at the first reading."""

    @abc.abstractmethod
    def predicted(
        self,
        reading: Reading,
        commanded: Float[Array, " m"],
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
    ) -> Prediction:
        """What the period (s) that ends with a reading is believed to have done."""

    def step(
        self,
        reading: Reading,
        commanded: Float[Array, " m"],
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
        uncertainty: RealScalar,
    ) -> tuple[Residual, FilterMemory]:
        """The residual of the period (s) that ends with a reading, and the next memory.

        `commanded` is what actuators were to do in that period. Torques are believed to be wrong by
        the part `uncertainty` of themselves.
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
            steady,
            ahead.driven,
        )
        after = memory.estimate + ahead.change + gain[None] * innovation
        following = FilterMemory(
            jnp.where(started, after, measurement),
            jnp.where(started, left * predicted, noise),
            left[None] * residual.loss,
            left[None] * residual.flow,
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
        """The condition with the flows that actuators make all the time, and the torque, corrected.

        The latter only while it is `quiet`: nothing is suspected.
        """

    @abc.abstractmethod
    def test_command(self, period: RealScalar, sigma: Float[Array, " k"]) -> Float[Array, " m"]:
        """Commands of test pulses that stand out of errors of this standard deviation."""

    def torque_of(self, acceleration: Vector) -> Vector:
        """The torque (N m) that makes an acceleration (rad/s²); none of what is on board."""
        return jnp.zeros_like(acceleration)

    def named(self, kind: IntScalar, actuator: IntScalar, memory: FilterMemory) -> IntScalar:
        """The kind of a verdict; here as it was isolated."""
        return kind
