"""From a commanded torque to the thrusts that make it with least propellant."""

from functools import reduce

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.checks import as_float
from jaxsat.quotients import reciprocal
from jaxsat.smooth import positive_part


class LeastPropellant(eqx.Module):
    """Duties of thrusters that push, which make a torque with least propellant.

    The duties d >= 0 minimise costᵀd subject to B d = M u, B (3, m) the torques at full thrust. By
    the theory of linear programming some basis of as many thrusters as B has rows is optimal, and
    which one depends on the direction of u alone. `duties` (bases, m, torques) has the duties a
    unit of u for every basis that is optimal in some direction, so that the solution is the one
    that has no negative duty: no iteration, no matrix to invert in the loop. At most `firing`
    thrusters have a duty above zero.
    """

    duties: Float[Array, "bases m torques"] = eqx.field(converter=as_float)
    firing: int = eqx.field(static=True)

    @staticmethod
    def of(duties: Float[np.ndarray, "bases m torques"]) -> "LeastPropellant":
        """The allocation by a table of `jaxsat.allocation.least_propellant`."""
        return LeastPropellant(duties, int(np.count_nonzero(duties.any(axis=2), axis=1).max()))

    def __call__(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Duties for a command (N m): parts of full thrust on average over a period.

        A command beyond what the thrusters can make is reduced in size, not turned.
        """
        candidates = jnp.sum(self.duties * command[None, None, :], axis=-1)
        best = jnp.argmax(reduce(_smaller, candidates.T))
        duty = positive_part(candidates[best])  # with zero torque, all of it counts in the slope
        return duty * reciprocal(jnp.maximum(jnp.max(duty), 1.0))


def _smaller(x: Float[Array, " bases"], y: Float[Array, " bases"]) -> Float[Array, " bases"]:
    """The smaller one, for numbers; which basis is chosen for NaN does not matter."""
    return jnp.where(x < y, x, y)
