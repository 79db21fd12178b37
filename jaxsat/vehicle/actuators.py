"""From the torque a law commands to the torque the body feels."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.checks import as_float, require_positive
from jaxsat.vehicle.thrusters import Thrusters, allocation


class Actuators(eqx.Module):
    """Thrusters that turn a commanded torque (u1, u2) about body x and y into a body torque.

    `torque_axes` (3, m) are the directions of the working thrusters' torques, `thrust_map` (m, 2)
    shares the command among them, and `limit` (N m, may be infinite) bounds each thruster.
    """

    torque_axes: Float[Array, "3 m"] = eqx.field(converter=as_float)
    thrust_map: Float[Array, "m 2"] = eqx.field(converter=as_float)
    limit: Float[Array, ""] = eqx.field(converter=as_float, default=jnp.inf)

    def __check_init__(self):
        require_positive("limit", self.limit)

    @staticmethod
    def of(thrusters: Thrusters, limit: float | Float[Array, ""] = jnp.inf) -> "Actuators":
        """Actuators made of working thrusters, each limited to `limit` N m.

        Raises `ValueError` where they cannot make torques about body x and y independently.
        """
        return Actuators(thrusters.torque_axes, allocation(thrusters), limit)

    def __call__(self, command: Float[Array, "2"]) -> Float[Array, "3"]:
        """The body torque, N m, each thruster clipped at its limit: T of equation (5)."""
        thrust = jnp.clip(self.thrust_map @ command, -self.limit, self.limit)
        return self.torque_axes @ thrust
