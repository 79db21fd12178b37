"""Rate changes that were not commanded: innovations of a filter, and what failures leave in them.

The residual is the measured change of angular momentum less the expected one, over the inertia.
Differences of measured rates have correlated noise; the innovations of a Kalman filter of the rate
do not. The filter's gain also says how a failure's signature decays in them.
"""

import abc
import math
from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.control.diagnosis.hypotheses import OF_THRUSTERS, Hypotheses
from jaxsat.control.diagnosis.isolation import AnyResidual
from jaxsat.control.diagnosis.thruster_model import ThrusterModel
from jaxsat.core.checks import as_float, require_positive
from jaxsat.spacecraft.dynamics import RigidBody

RealScalar = Float[Array, ""]

RESTLESSNESS = 0.25
"""Process noise over the noise of the rate, so that a signature decays by 0.39 a sample."""

TEST_SIGMAS = 6.0
"""Effect of a test pulse on what is read, over its noise."""

TRACKING, SLOW_TRACKING = 0.1, 0.03
"""Part of the error of a flow, and of the torque besides it, taken out with each sample."""

STEADY_GAIN = (math.sqrt(RESTLESSNESS**2 + 4 * RESTLESSNESS) - RESTLESSNESS) / 2
"""K of the filter after many samples at rest: K²/(1-K) is `RESTLESSNESS`."""

STEADY_VARIANCE = 1 / (1 - STEADY_GAIN)
"""Of the innovations then, over that of the noise."""

FIRST_SAMPLES, MOST_SAMPLES = 3.0, 300.0
"""The torque that acts besides is believed to be none as if so many samples had told so. It is
learned from so many; later on what a thruster lacks now and then would be learned as well."""

DOUBTED_SIGMAS, BELIEVED_SIGMAS = 2.0, 4.0
"""Of an estimate of that torque nothing is believed below, and all above."""


class Condition(NamedTuple):
    """What is believed of each actuator: whether it has `failed`, and what it makes.

    The part `part` of what is commanded, and the part `flow` of full torque all the time, which is
    what brakes a wheel. `torque` (N m) is what acts besides all the time: on the spacecraft from
    outside, and where others oppose a flow and make not quite what they should. As many `samples`
    tell of it.
    """

    failed: Bool[Array, " m"]
    part: Float[Array, " m"]
    flow: Float[Array, " m"]
    torque: Float[Array, "3"]
    samples: RealScalar

    @staticmethod
    def sound(count: int) -> "Condition":
        """All work, and nothing is known to act besides."""
        zero = jnp.zeros(count)
        return Condition(zero > 0, zero + 1, zero, jnp.zeros(3), jnp.array(0.0))


class ResidualMemory(NamedTuple):
    """The filtered rate (rad/s), its variance, and each thruster's signatures in it (rad/s).

    `steady` (s) is the signature of a constant acceleration over it. `late` (s) is on-time of each
    failed thruster that was missing and may still come late.
    """

    rate: Float[Array, "3"]
    variance: RealScalar
    loss: Float[Array, "3 m"]
    flow: Float[Array, "3 m"]
    steady: RealScalar
    late: Float[Array, " m"]
    started: Bool[Array, ""]


class Residual(NamedTuple):
    """An innovation (rad/s), its variance about each axis, and the signatures in it.

    `loss` is what a thruster leaves whose thrust has been missing (of one that counts as failed:
    has been there again), `flow` what one leaves that has had full thrust all the time, rad/s, and
    `steady` what a constant acceleration of 1 rad/s² leaves.
    """

    innovation: Float[Array, "3"]
    variance: RealScalar
    loss: Float[Array, "3 m"]
    flow: Float[Array, "3 m"]
    steady: RealScalar

    def doubt(self, uncertainty: RealScalar) -> RealScalar:
        """Its standard deviation (rad/s) if that part of it may be an error of the model."""
        return jnp.sqrt(self.variance + uncertainty**2 * jnp.sum(self.innovation**2))


class AbstractResidualFilter(eqx.Module):
    """What makes innovations of readings and commands, and knows what a failure leaves in them."""

    hypotheses: ClassVar[Hypotheses]

    uncertainty: eqx.AbstractVar[RealScalar]

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """How many actuators there are."""

    @property
    @abc.abstractmethod
    def noise(self) -> RealScalar | Float[Array, " m"]:
        """Standard deviation of what is read."""

    @abc.abstractmethod
    def init(self, reading: PyTree) -> PyTree:
        """Nothing measured yet."""

    @abc.abstractmethod
    def restarted(self, memory: PyTree, verdict: Bool[Array, ""], alarm: Bool[Array, ""]) -> PyTree:
        """The memory after a verdict, or an alarm, or neither."""

    @abc.abstractmethod
    def step(
        self,
        reading: PyTree,
        commanded: Float[Array, " m"],
        condition: "Condition",
        period: RealScalar,
        memory: PyTree,
    ) -> tuple[AnyResidual, PyTree]:
        """The residual of the period (s) that ends with a reading, and the next memory."""

    @abc.abstractmethod
    def tracked(
        self,
        residual: AnyResidual,
        condition: "Condition",
        period: RealScalar,
        quiet: Bool[Array, ""],
    ) -> "Condition":
        """With the flows that actuators make all the time, and the torque besides, corrected.

        The latter only while it is `quiet`: nothing is suspected.
        """

    @abc.abstractmethod
    def test_command(
        self, period: RealScalar, sigma: RealScalar | Float[Array, " m"]
    ) -> Float[Array, " m"]:
        """Commands of test pulses that stand out of errors of this standard deviation."""

    def torque_of(self, acceleration: Float[Array, "3"]) -> Float[Array, "3"]:
        """The torque (N m) that makes an acceleration (rad/s²); none of what is on board."""
        return jnp.zeros_like(acceleration)

    def named(
        self, kind: Int[Array, ""], actuator: Int[Array, ""], memory: PyTree
    ) -> Int[Array, ""]:
        """The kind of a verdict; here as it was found."""
        del actuator, memory
        return kind


class ResidualFilter(AbstractResidualFilter):
    """A Kalman filter of the rate about three axes alike, with a scalar variance.

    `model` is the plant as the law believes it, `rate_noise` (rad/s) the standard deviation of an
    estimated rate. Torques of thrusters, and gyroscopic ones, are believed to be wrong by the part
    `uncertainty` of themselves. What a failed thruster does not make when it is commanded may come
    late. For some samples its effect is in doubt, and is not taken for a failure of another.
    """

    hypotheses: ClassVar[Hypotheses] = OF_THRUSTERS

    model: RigidBody
    thrusters: ThrusterModel
    rate_noise: RealScalar = eqx.field(converter=as_float)
    uncertainty: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        for name in ("rate_noise", "uncertainty"):
            require_positive(name, getattr(self, name))

    @property
    def count(self) -> int:
        """How many thrusters there are."""
        return self.thrusters.count

    @property
    def noise(self) -> RealScalar:
        """That of a rate, rad/s."""
        return self.rate_noise

    def init(self, reading: Float[Array, "3"]) -> ResidualMemory:
        """Nothing measured yet."""
        none = jnp.zeros((3, self.thrusters.count), reading.dtype)
        no, noise = jnp.array(False), self.rate_noise**2
        return ResidualMemory(reading, noise, none, none, none[0, 0], none[0], no)

    def restarted(
        self, memory: ResidualMemory, verdict: Bool[Array, ""], alarm: Bool[Array, ""]
    ) -> ResidualMemory:
        """As before the first sample after a verdict."""
        del alarm
        return memory._replace(started=memory.started & ~verdict)

    def step(
        self,
        reading: Float[Array, "3"],
        commanded: Float[Array, " m"],
        condition: "Condition",
        period: RealScalar,
        memory: ResidualMemory,
    ) -> tuple[Residual, ResidualMemory]:
        """The residual of the period that ends with the estimated rate that is read (rad/s).

        The on-time (s) of each thruster was commanded in it.
        """
        omega, on_time = reading, commanded
        noise, started = self.rate_noise**2, memory.started
        inverse = self.model.spacecraft.inverse_inertia
        effect = inverse @ self.thrusters.torque
        middle = (memory.rate + omega) / 2
        turning = jnp.cross(middle, self.model.spacecraft.inertia @ middle)
        gyroscopic = -period * (inverse @ turning)
        expected = condition.part * on_time + condition.flow * period
        besides = self.believed(condition, period)
        change = effect @ expected + gyroscopic + period * (inverse @ besides)
        doubt = jnp.sum((effect * expected[None]) ** 2) + jnp.sum(gyroscopic**2)
        predicted = memory.variance + RESTLESSNESS * noise + self.uncertainty**2 * doubt
        variance = predicted + noise
        gain = jnp.where(started, predicted / variance, 1.0)
        innovation = jnp.where(started, omega - memory.rate - change, 0.0)
        change_of_loss = jnp.where(condition.failed, 1 - condition.part, -condition.part) * on_time
        loss = jnp.where(started, memory.loss + effect * change_of_loss[None], 0.0)
        flow = jnp.where(started, memory.flow + effect * period, 0.0)
        steady = jnp.where(started, memory.steady + period, 0.0)
        left = 1 - gain
        rate = jnp.where(started, memory.rate + change + gain * innovation, omega)
        following = ResidualMemory(
            rate,
            jnp.where(started, left * predicted, noise),
            left * loss,
            left * flow,
            left * steady,
            jnp.where(condition.failed, left * memory.late + change_of_loss, 0.0),
            jnp.array(True),
        )
        late = jnp.sum((effect * memory.late[None]) ** 2)
        return Residual(innovation, variance + late, loss, flow, steady), following

    def tracked(
        self,
        residual: AnyResidual,
        condition: Condition,
        period: RealScalar,
        quiet: Bool[Array, ""],
    ) -> Condition:
        """With the flows of failed thrusters that have one, and the torque, corrected.

        Where there is no flow, the torque is the mean of what the last samples tell, each by the
        information in it.
        """
        body = self.model.spacecraft
        effect = period * (body.inverse_inertia @ self.thrusters.torque)
        more = jnp.sum(effect * residual.innovation[:, None], axis=0) / jnp.sum(effect**2, axis=0)
        flows = condition.failed & (condition.flow > 0)
        flow = jnp.clip(condition.flow + TRACKING * more, 0.0, 1.0)
        opposed, steady = jnp.any(flows), cast(RealScalar, residual.steady)
        told = (steady * STEADY_GAIN / period) ** 2
        told = told * STEADY_VARIANCE * self.rate_noise**2 / residual.variance
        told = jnp.where(quiet & (condition.samples < MOST_SAMPLES), told, 0.0)
        samples = condition.samples + told
        mean = told / (samples + FIRST_SAMPLES) / jnp.where(steady > 0, steady, 1.0)
        part = jnp.where(opposed, SLOW_TRACKING / period, mean)
        doubted = condition.torque - self.believed(condition, period)
        error = residual.innovation - steady * (body.inverse_inertia @ doubted)
        return condition._replace(
            flow=jnp.where(flows, flow, condition.flow),
            torque=condition.torque + part * (body.inertia @ error),
            samples=jnp.where(opposed, 0.0, samples),
        )

    def believed(self, condition: Condition, period: RealScalar) -> Float[Array, "3"]:
        """Of the torque that acts besides, what stands out of the noise of its estimate, N m."""
        rate = self.model.spacecraft.inverse_inertia @ condition.torque * period
        known = jnp.sqrt(condition.samples + FIRST_SAMPLES)
        sigma = STEADY_GAIN * jnp.sqrt(STEADY_VARIANCE) * self.rate_noise / known
        squares = jnp.sum((rate / sigma) ** 2)
        some = squares > 0  # the square root has no derivative at zero
        sigmas = jnp.where(some, jnp.sqrt(jnp.where(some, squares, 1.0)), 0.0)
        opposed = jnp.any(condition.failed & (condition.flow > 0))
        part = (sigmas - DOUBTED_SIGMAS) / (BELIEVED_SIGMAS - DOUBTED_SIGMAS)
        return jnp.where(opposed, 1.0, jnp.clip(part, 0.0, 1.0)) * condition.torque

    def torque_of(self, acceleration: Float[Array, "3"]) -> Float[Array, "3"]:
        """The torque (N m) that makes an acceleration (rad/s²)."""
        return self.model.spacecraft.inertia @ acceleration

    def test_command(self, period: RealScalar, sigma: RealScalar) -> Float[Array, " m"]:
        """Duties of pulses that stand out of errors of a rate (rad/s)."""
        effect = self.model.spacecraft.inverse_inertia @ self.thrusters.torque
        seen = TEST_SIGMAS * sigma / jnp.sqrt(jnp.sum(effect**2, axis=0))
        return jnp.minimum(jnp.maximum(seen, self.thrusters.min_on_time) / period, 1.0)
