"""Rate changes that were not commanded: innovations of a filter, and what failures leave in them.

The residual is the measured change of angular momentum less the expected one, over the inertia.
Differences of measured rates have correlated noise; the innovations of a Kalman filter of the rate
do not. The filter's gain also says how a failure's signature decays in them.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.checks import as_float, require_positive
from jaxsat.diagnosis.thruster_model import ThrusterModel
from jaxsat.dynamics import RigidBody

RealScalar = Float[Array, ""]

RESTLESSNESS = 0.25
"""Process noise over the noise of the rate, so that a signature decays by 0.39 a sample."""


class Condition(NamedTuple):
    """What is believed of each thruster: whether it has `failed`, and what it makes.

    The part `part` of what is commanded, and the part `flow` of full thrust all the time. `torque`
    (N m) is what acts besides all the time, where the others oppose a flow and make not quite what
    they should.
    """

    failed: Bool[Array, " m"]
    part: Float[Array, " m"]
    flow: Float[Array, " m"]
    torque: Float[Array, "3"]

    @staticmethod
    def sound(count: int) -> "Condition":
        """All work."""
        zero = jnp.zeros(count)
        return Condition(zero > 0, zero + 1, zero, jnp.zeros(3))


class ResidualMemory(NamedTuple):
    """The filtered rate (rad/s), its variance, and each thruster's signatures in it (rad/s).

    `late` (s) is on-time of each failed thruster that was missing and may still come late.
    """

    rate: Float[Array, "3"]
    variance: RealScalar
    loss: Float[Array, "3 m"]
    flow: Float[Array, "3 m"]
    late: Float[Array, " m"]
    started: Bool[Array, ""]


class Residual(NamedTuple):
    """An innovation (rad/s), its variance about each axis, and the signatures in it.

    `loss` is what a thruster leaves whose thrust has been missing (of one that counts as failed:
    has been there again), `flow` what one leaves that has had full thrust all the time, rad/s.
    """

    innovation: Float[Array, "3"]
    variance: RealScalar
    loss: Float[Array, "3 m"]
    flow: Float[Array, "3 m"]

    def doubt(self, uncertainty: RealScalar) -> RealScalar:
        """Its standard deviation (rad/s) if that part of it may be an error of the model."""
        return jnp.sqrt(self.variance + uncertainty**2 * jnp.sum(self.innovation**2))


class ResidualFilter(eqx.Module):
    """A Kalman filter of the rate about three axes alike, with a scalar variance.

    `model` is the plant as the law believes it, `rate_noise` (rad/s) the standard deviation of an
    estimated rate. Torques of thrusters, and gyroscopic ones, are believed to be wrong by the part
    `uncertainty` of themselves. What a failed thruster does not make when it is commanded may come
    late. For some samples its effect is in doubt, and is not taken for a failure of another.
    """

    model: RigidBody
    thrusters: ThrusterModel
    rate_noise: RealScalar = eqx.field(converter=as_float)
    uncertainty: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        for name in ("rate_noise", "uncertainty"):
            require_positive(name, getattr(self, name))

    def init(self, omega: Float[Array, "3"]) -> ResidualMemory:
        """Nothing measured yet."""
        none = jnp.zeros((3, self.thrusters.count), omega.dtype)
        return ResidualMemory(omega, self.rate_noise**2, none, none, none[0], jnp.array(False))

    def restarted(self, memory: ResidualMemory, when: Bool[Array, ""]) -> ResidualMemory:
        """As before the first sample where `when` holds."""
        return memory._replace(started=memory.started & ~when)

    def step(
        self,
        omega: Float[Array, "3"],
        on_time: Float[Array, " m"],
        condition: "Condition",
        period: RealScalar,
        memory: ResidualMemory,
    ) -> tuple[Residual, ResidualMemory]:
        """The residual of the period that ends with the estimated rate `omega` (rad/s).

        `on_time` (s) of each thruster was commanded in it.
        """
        noise, started = self.rate_noise**2, memory.started
        inverse = self.model.spacecraft.inverse_inertia
        effect = inverse @ self.thrusters.torque
        middle = (memory.rate + omega) / 2
        turning = jnp.cross(middle, self.model.spacecraft.inertia @ middle)
        gyroscopic = -period * (inverse @ turning)
        expected = condition.part * on_time + condition.flow * period
        change = effect @ expected + gyroscopic + period * (inverse @ condition.torque)
        doubt = jnp.sum((effect * expected[None]) ** 2) + jnp.sum(gyroscopic**2)
        predicted = memory.variance + RESTLESSNESS * noise + self.uncertainty**2 * doubt
        variance = predicted + noise
        gain = jnp.where(started, predicted / variance, 1.0)
        innovation = jnp.where(started, omega - memory.rate - change, 0.0)
        change_of_loss = jnp.where(condition.failed, 1 - condition.part, -1.0) * on_time
        loss = jnp.where(started, memory.loss + effect * change_of_loss[None], 0.0)
        steady = jnp.where(started, memory.flow + effect * period, 0.0)
        left = 1 - gain
        rate = jnp.where(started, memory.rate + change + gain * innovation, omega)
        following = ResidualMemory(
            rate,
            jnp.where(started, left * predicted, noise),
            left * loss,
            left * steady,
            jnp.where(condition.failed, left * memory.late + change_of_loss, 0.0),
            jnp.array(True),
        )
        late = jnp.sum((effect * memory.late[None]) ** 2)
        return Residual(innovation, variance + late, loss, steady), following
