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
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.riccati import regulator_gain
from jaxsat.control.tilt import Tilt
from jaxsat.dynamics import PlantState, RigidBody

STATE_SCALE = (0.1, 0.1, 0.02, 0.01, 0.01, 0.001)
"""Deviations of (φ, θ, z, ω1, ω2 + ω0, ω3) that cost as much as `TORQUE_SCALE`: rad, rad/s."""

TORQUE_SCALE = 0.1
"""N m."""


def linear_model(form: NormalForm) -> tuple[np.ndarray, np.ndarray]:
    """A (6, 6) and B (6, 2) of the plant about rest relative to the orbit frame.

    The state is (φ, θ, z, and p1, p2, s less their values at rest), small angles in rad and rates
    in rad/s; the input is the torque about x and y in N m. Derivatives of the model's own
    equations (1), (10), (11) by JAX.
    """
    a, b = (np.asarray(matrix) for matrix in _derivatives(form.model))
    # The same rows turn angles into (φ, θ, z), and rates into those of p1, p2 and s.
    turned = np.asarray(form.axes, dtype=float).copy()
    turned[2] -= np.asarray(form.lean) @ turned[:2]
    into = np.kron(np.eye(2), turned)
    return into @ a @ np.linalg.inv(into), into @ b @ np.asarray(form.axes)[:2].T


@eqx.filter_jit  # one program instead of hundreds of operations compiled one by one
def _derivatives(model: RigidBody) -> tuple[Array, Array]:
    def rate(deviation, torque):
        vector = deviation[:3] / 2
        scalar = jnp.sqrt(1 - jnp.sum(vector**2))
        attitude = Quaternion(jnp.concatenate([scalar[None], vector]))
        omega = deviation[3:].at[1].add(-model.orbit.rate)
        change = model.rate(jnp.zeros(()), PlantState(attitude, omega), torque)
        turn = cast(Quaternion, change.attitude).q[1:]
        return jnp.concatenate([2 * turn, change.omega])

    return jax.jacfwd(rate, argnums=(0, 1))(jnp.zeros(6), jnp.zeros(3))


class OrbitalRegulator(eqx.Module):
    """u = -gain x with x = (φ, θ, z, and p1, p2, s less their values at rest); shape (2, 6).

    z is the turn that goes with s: the turn about n less ε1 φ + ε2 θ. The torques are about x, y.

    Made by `design`, or from a gain of one's own.
    """

    gain: Float[Array, "2 6"] = eqx.field(converter=as_float)

    @staticmethod
    def design(
        form: NormalForm,
        state_scale: ArrayLike | tuple = STATE_SCALE,
        torque_scale: ArrayLike | float = TORQUE_SCALE,
    ) -> "OrbitalRegulator":
        """The linear quadratic regulator with Q = diag(state_scale)⁻² and R = torque_scale⁻² I.

        Solved with SciPy when the object is made, so `form` must be concrete. Raises `ValueError`
        where the linear system cannot be stabilised: c = 0, no orbit, or one whose rate is along n.
        """
        a, b = linear_model(form)
        state_weight = np.diag(np.broadcast_to(np.asarray(state_scale, float), (6,)) ** -2.0)
        torque_weight = np.diag(np.broadcast_to(np.asarray(torque_scale, float), (2,)) ** -2.0)
        gain = regulator_gain(a, b, state_weight, torque_weight)
        return OrbitalRegulator(gain)

    def torque(
        self,
        tilt: Tilt,
        turn: Float[Array, ""],
        excess: Float[Array, "3"],
    ) -> Float[Array, "2"]:
        """The torque, N m. `excess` is (p1, p2, s) less its value at rest, rad/s.

        `turn` (rad) and `excess[2]` may have their ripple removed.
        """
        state = jnp.concatenate([jnp.stack([tilt.phi, tilt.theta, turn]), excess])
        return -jnp.sum(self.gain * state[None, :], axis=1)
