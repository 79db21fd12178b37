"""Rounding of duties to whole pulses with the nearest torque impulse."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_float, not_negative

ROUNDS = 2
"""Largest number of pulses added in a period to the whole ones."""

WORTH = 0.7
"""Smallest demanded rate change along a pulse, relative to the pulse's own, for which it fires.

At one half the error would be as large the other way, and noise would fire the opposite pulse.
"""


class PulseRounding(eqx.Module):
    """Rounding of all thrusters' duties to whole pulses with a small joint error of the rate.

    Separate remainders of thrusters would add up: sums of several err by several pulses, and those
    of opposite thrusters by noise without a mean. Here the owed rate change is one vector, and the
    thruster that reduces it most fires the pulse. `effect` (3, m) is the rate change at full thrust
    (rad/s²), `least` (s) the pulse of each, zero for any width.
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

        They also produce the rate change `besides` (rad/s), which exceeds the given duties, if
        given. Thrusters produce the part `limit` of their thrust, and do not fire if it is zero.
        Duties of thrusters without a smallest pulse are unchanged.
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
