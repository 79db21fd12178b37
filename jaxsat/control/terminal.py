"""The end game: a linear regulator about the orbit frame.

In orbit the third axis can be steered without oscillation. At rest relative to the orbit frame
the body turns at ω2 = -ω0, so dω3/dt = -c ω0 ω1 + ..., and the linear system is controllable with
two torques if ω0 ≠ 0 and J1 ≠ J2 (rank 6; 5 if J1 = J2; 4 if ω0 = 0). One mode is very slow.
"""

from typing import cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.attitude import Quaternion
from jaxsat.checks import as_float
from jaxsat.control.riccati import regulator_gain
from jaxsat.control.tilt import Tilt
from jaxsat.dynamics import PlantState, RigidBody

STATE_SCALE = (0.1, 0.1, 0.02, 0.01, 0.01, 0.001)
"""Deviations of (φ, θ, z, ω1, ω2 + ω0, ω3) that cost as much as `TORQUE_SCALE`: rad, rad/s."""

TORQUE_SCALE = 0.1
"""N m."""


def linear_model(model: RigidBody) -> tuple[np.ndarray, np.ndarray]:
    """A (6, 6) and B (6, 2) of the plant about rest relative to the orbit frame.

    The state is (φ, θ, z, ω1, ω2 + ω0, ω3), small angles in rad and rates in rad/s; the input is
    (u1, u2) in N m. Derivatives of the model's own equations (1), (10), (11) by JAX.
    """

    a, b = _derivatives(model)
    return np.asarray(a), np.asarray(b)


@eqx.filter_jit  # one program instead of hundreds of operations compiled one by one
def _derivatives(model: RigidBody) -> tuple[Array, Array]:
    def rate(deviation, torque):
        vector = deviation[:3] / 2
        scalar = jnp.sqrt(1 - jnp.sum(vector**2))
        attitude = Quaternion(jnp.concatenate([scalar[None], vector]))
        omega = deviation[3:].at[1].add(-model.orbit.rate)
        body_torque = jnp.concatenate([torque, jnp.zeros(1)])
        change = model.rate(jnp.zeros(()), PlantState(attitude, omega), body_torque)
        turn = cast(Quaternion, change.attitude).q[1:]
        return jnp.concatenate([2 * turn, change.omega])

    return jax.jacfwd(rate, argnums=(0, 1))(jnp.zeros(6), jnp.zeros(2))


class OrbitalRegulator(eqx.Module):
    """u = -gain x with x = (φ, θ, z, ω1, ω2 + ω0, ω3); `gain` has shape (2, 6).

    Made by `design`, or from a gain of one's own.
    """

    gain: Float[Array, "2 6"] = eqx.field(converter=as_float)
    orbit_rate: Float[Array, ""] = eqx.field(converter=as_float)

    @staticmethod
    def design(
        model: RigidBody,
        state_scale: ArrayLike | tuple = STATE_SCALE,
        torque_scale: ArrayLike | float = TORQUE_SCALE,
    ) -> "OrbitalRegulator":
        """The linear quadratic regulator with Q = diag(state_scale)⁻² and R = torque_scale⁻² I.

        Solved with SciPy when the object is made, so `model` must be concrete. Raises `ValueError`
        where the linear system cannot be stabilised: J1 = J2 or no orbit.
        """
        a, b = linear_model(model)
        state_weight = np.diag(np.broadcast_to(np.asarray(state_scale, float), (6,)) ** -2.0)
        torque_weight = np.diag(np.broadcast_to(np.asarray(torque_scale, float), (2,)) ** -2.0)
        gain = regulator_gain(a, b, state_weight, torque_weight)
        return OrbitalRegulator(gain, model.orbit.rate)

    def torque(
        self,
        tilt: Tilt,
        turn: Float[Array, ""],
        omega: Float[Array, "3"],
    ) -> Float[Array, "2"]:
        """The torque, N m. `turn` (rad) and `omega[2]` (rad/s) may have their ripple removed."""
        state = jnp.stack(
            [tilt.phi, tilt.theta, turn, omega[0], omega[1] + self.orbit_rate, omega[2]]
        )
        return -jnp.sum(self.gain * state[None, :], axis=1)
