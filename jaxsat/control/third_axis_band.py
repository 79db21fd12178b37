"""Dead band of thrusters about the axis that no wheel drives.

A persistent torque brings the error to an edge of the band. There thrusters fire once and reverse
the rate, as a ball bounces: the error returns on the same path to the same edge. No thruster fires
against another, so that the propellant is that of the torque's own momentum. An error that has
crossed the band is turned back as slowly as pulses allow.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.checks import as_float, positive
from jaxsat.core.declaration.three_torques import CALM
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.dynamics import PlantState

LEAVE = 2.0
"""Error, relative to the band, beyond which feedback returns it."""

RETURN = 0.01
"""Smallest rate of return, relative to band times natural frequency."""

ALIKE = 0.99
"""Share of the best momentum per propellant above which thrusters are treated as equal."""


class BandMemory(NamedTuple):
    """Whether the axis `coasts` between its edges, and the edge of the last reversal.

    `edge` is the sign of the error there, 0 for neither.
    """

    coasts: BoolScalar
    edge: RealScalar

    @staticmethod
    def begin() -> "BandMemory":
        """The memory under feedback."""
        return BandMemory(jnp.array(False), jnp.array(0.0))


class Corrected(NamedTuple):
    """The duty of each thruster, the torque (N m) without the part about the axis, less the pulses'
    torque across it, and the next memory."""

    duty: Float[Array, " m"]
    torque: Vector
    memory: BandMemory


class ThirdAxisBand(eqx.Module):
    """Errors up to `band` (rad) about the axis that no wheel drives are not corrected.

    `thrust` (3, m) is the torque of each thruster (N m), `least` (s) its smallest pulse, zero for
    any width, and `cost` the cost of full thrust.
    """

    band: RealScalar = eqx.field(converter=positive("band"))
    thrust: Float[Array, "3 m"] = eqx.field(converter=as_float)
    least: Float[Array, " m"] = eqx.field(converter=as_float)
    cost: Float[Array, " m"] = eqx.field(converter=as_float)

    def correct(
        self,
        state: PlantState,
        law: QuaternionFeedback,
        axis: Vector,
        torque: Vector,
        stored: Vector,
        limit: Float[Array, " m"],
        before: BandMemory,
    ) -> Corrected:
        """Duties and remaining torque for a `torque` (N m) and the unit `axis` n; a zero axis has
        no band.

        Wheels hold momentum `stored` (N m s); among equally efficient thrusters the one is chosen
        that reduces it most. Thrusters produce the part `limit` of their thrust. Accelerations
        across n are those of the commanded torque: J n / n·Jn turns the body about n alone.
        """
        inertia = law.model.spacecraft.inertia
        moment = jnp.maximum(axis @ inertia @ axis, SMALLEST)
        along = inertia @ axis / moment
        quaternion = state.attitude.as_quaternion().q
        shorter = jnp.where(quaternion[0] < 0, -1.0, 1.0)
        error = 2 * shorter * (axis @ quaternion[1:])
        rate = axis @ (state.omega - law.model.orbit.frame_rate(state.attitude))
        calm = CALM * law.natural_frequency * self.band
        side = jnp.where(error < 0, -1.0, 1.0)
        push = -side * (axis @ self.thrust) * limit / moment  # inward, rad/s²
        step = push * self.least
        able = push > 0
        biggest = jnp.max(jnp.where(able, step, 0.0))
        near = (jnp.abs(error) < self.band) & (jnp.abs(rate) < jnp.maximum(calm, 2 * biggest))
        coasts = jnp.any(able) & (near | (before.coasts & (jnp.abs(error) < LEAVE * self.band)))
        coasts = coasts & jnp.any(axis != 0)
        worth = jnp.where(able, push / self.cost, 0.0)
        alike = able & (worth > ALIKE * jnp.max(worth))
        relief = stored @ self.thrust  # negative: reduces the stored momentum
        best = jnp.argmin(jnp.where(alike, relief, jnp.inf))
        inwards = -side * rate
        slowest = jnp.maximum(step[best] / 2, RETURN * law.natural_frequency * self.band)
        crossed = before.edge == -side
        change = jnp.where(crossed, slowest, jnp.maximum(slowest, -inwards)) - inwards
        on_time = change / jnp.maximum(push[best], SMALLEST)
        pulse = jnp.where(self.least[best] > 0, self.least[best], 1.0)
        whole = jnp.maximum(jnp.round(on_time / pulse), 1.0) * pulse
        on_time = jnp.where(self.least[best] > 0, whole, on_time)
        fires = coasts & (jnp.abs(error) > self.band) & (inwards <= 0)
        most = jnp.floor(law.period / pulse * (1 + 1e-12)) * pulse
        most = jnp.where(self.least[best] > 0, most, law.period)
        firing = fires & (jnp.arange(self.least.shape[0]) == best)
        duty = jnp.where(firing, jnp.minimum(on_time, most) / law.period, 0.0)
        pulse_torque = self.thrust @ (limit * duty)
        rest = torque - along * (axis @ torque) + along * (axis @ pulse_torque) - pulse_torque
        edge = jnp.where(coasts, jnp.where(fires, side, before.edge), 0.0)
        return Corrected(duty, jnp.where(coasts, rest, torque), BandMemory(coasts, edge))
