"""A relay: the smallest loop in pieces, with an exact solution to hold an integrator against."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from helpers.paper import PAPER_THREE_AXIS, bodies
from jaxsat.core.attitude import WZ
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case
from jaxsat.simulation.loops import AbstractContinuousLoop, Motion
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class RelayState(NamedTuple):
    position: Float[Array, ""]
    velocity: Float[Array, ""]


class Relay(AbstractContinuousLoop):
    """x'' = -k sgn(x - level), or, without inertia, x' = -k sgn(x - level).

    x is the plant's turn z and the relay's force the torque about its first axis.
    """

    plant: RigidBody
    k: Float[Array, ""]
    level: Float[Array, ""]
    inertia: bool = eqx.field(static=True, default=True)
    above: Bool[Array, ""] | None = None

    @property
    def torque_count(self) -> int:
        return 1

    def start(self, state: PlantState) -> RelayState:
        return RelayState(state.attitude.z, state.omega[0])

    def _force(self, state):
        above = state.position > self.level if self.above is None else self.above
        return self.k * jnp.where(above, -1.0, 1.0)

    def motion(self, t, state):
        force = self._force(state)
        moving = RelayState(state.velocity, force)
        rate = moving if self.inertia else RelayState(force, jnp.zeros_like(force))
        zero = jnp.zeros(3)
        plant = PlantState(WZ(jnp.zeros(2), state.position), zero.at[0].set(state.velocity))
        return Motion(rate, plant, zero, zero[:2], zero.at[0].set(force))

    def signals(self, t, state):
        motion = self.motion(t, state)
        none = jnp.zeros(())
        return Signals(
            w=motion.plant.attitude.w,
            z=motion.plant.attitude.z,
            quaternion=motion.plant.attitude.as_quaternion().q,
            omega=motion.plant.omega,
            relative_rate=motion.relative_rate,
            torque=motion.torque,
            disturbance=jnp.zeros(3),
            rate_error=jnp.zeros(2),
            lyapunov=none,
            mode=none,
        )

    def event_functions(self, t, state):
        return (state.position - self.level)[None]

    def smooth_piece(self, signs):
        return eqx.tree_at(lambda loop: loop.above, self, signs[0], is_leaf=lambda x: x is None)

    def integrating_factor(self, t):
        return None

    def plant_state(self, t, state):
        return self.motion(t, state).plant


class Relays(AbstractCaseFactory):
    """A relay from another place and with another velocity in every case, and with another k."""

    loop: Relay

    def __call__(self, case, gains):
        loop = self.loop if gains is None else eqx.tree_at(lambda loop: loop.k, self.loop, gains)
        zero = jnp.zeros(2)
        start = PlantState(WZ(zero, case[0]), jnp.zeros(3).at[0].set(case[1]))
        return Case(loop, start, {}, jnp.array(True))


def relay(level=0.0, inertia=True):
    return Relay(bodies(PAPER_THREE_AXIS)[0], jnp.array(1.0), jnp.array(level), inertia)


def exact_relay(k, position, velocity, duration):
    """Last position and velocity of x'' = -k sgn x, ∫x² and ∫|force|, from parabola to parabola."""
    nodes, weights = np.polynomial.legendre.leggauss(4)  # x² is of fourth order in time
    t, cost = 0.0, 0.0
    while t < duration:
        side = np.sign(position) or np.sign(velocity)
        a, b, c = -side * k / 2, velocity, position
        roots = np.roots([a, b, c])
        ahead = roots[np.isreal(roots) & (roots.real > 1e-9)].real
        length = min(ahead.min(), duration - t)
        s = length * (nodes + 1) / 2
        cost += length / 2 * np.sum(weights * (a * s**2 + b * s + c) ** 2)
        at_root = length < duration - t
        position = 0.0 if at_root else a * length**2 + b * length + c
        velocity, t = 2 * a * length + b, t + length
    return position, velocity, cost, k * duration
