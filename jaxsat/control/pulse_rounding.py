"""Whole pulses whose torque impulse is nearest to that of the duties that were asked for."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_float, not_negative

ROUNDS = 2
"""Pulses that are added at most to what is surely whole, in a period."""

WORTH = 0.7
"""Of a pulse's own effect: the least rate change along it that is still wanted when it is given.

At a half it would be as wrong afterwards the other way, and noise would set off its opposite.
"""


class PulseRounding(eqx.Module):
    """Thrusters that give whole pulses leave an error of the rate; this keeps it small in all.

    What each thruster owes by itself would add up: the sums of several err by several pulses, and
    those of opposite thrusters by noise that has no mean. Here the rate change that is owed is one
    vector, and a pulse is given by whatever thruster lessens it most. `effect` (3, m) is the rate
    change at full thrust (rad/s²), `least` (s) the pulse of each, zero where any width will do.
    """

    effect: Float[Array, "3 m"] = eqx.field(converter=as_float)
    least: Float[Array, " m"] = eqx.field(converter=not_negative("least"))

    def __call__(
        self,
        limit: Float[Array, " m"],
        duty: Float[Array, " m"],
        period: RealScalar,
        besides: Vector | None = None,
    ) -> Float[Array, " m"]:
        """Duties (parts of a period, s) that are whole pulses, or all the period long.

        They also make the rate change `besides` (rad/s), for which duties have no room, if given.
        Thrusters make the part `limit` of their thrust, and none if it is zero. The duties of those
        without a least pulse stay as they are.
        """
        free = self.least <= 0
        least = jnp.where(free, period, self.least)
        most = jnp.ceil(period / least * (1 - 1e-12))
        count = jnp.floor(duty * period / least * (1 + 1e-12))
        count = jnp.where(duty < 1 - 1e-12, jnp.maximum(count, 0.0), most)
        remainder = duty * period - jnp.minimum(count * least, period)
        owed = self.effect @ jnp.where(free, 0.0, limit * remainder)
        owed = owed if besides is None else owed + besides
        for _ in range(ROUNDS):
            pulse = self.effect * (limit * jnp.minimum(least, period - count * least))[None]
            square = jnp.sum(pulse**2, axis=0)
            along = jnp.sum(pulse * owed[:, None], axis=0)
            gives = (along > WORTH * square) & (count < most) & (limit > 0) & ~free
            best = jnp.argmax(jnp.where(gives, 2 * along - square, -1.0))
            one = gives & (jnp.arange(least.shape[0]) == best)
            count = count + one.astype(count.dtype)
            owed = owed - jnp.sum(jnp.where(one[None], pulse, 0.0), axis=1)
        return jnp.where(free, duty, jnp.minimum(count * least, period) / period)
