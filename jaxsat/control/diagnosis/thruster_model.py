"""What is believed of a set of thrusters: torques, and the on-times that follow from pulses."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.checks import as_float, require_finite, require_positive
from jaxsat.spacecraft import AbstractModulation


class ThrusterModel(eqx.Module):
    """Torques `torque` (3, m) at full thrust (N m), and the modulation that makes pulses of duties.

    Thrust begins `opening_delay` (s) after a command to open, on average over its rise, and ends
    `closing_delay` (s) after one to shut. It is a model as the law's `RigidBody` is one: the
    thrusters of the plant may differ.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=as_float)
    min_on_time: Float[Array, " m"] = eqx.field(converter=as_float)
    opening_delay: Float[Array, " m"] = eqx.field(converter=as_float)
    closing_delay: Float[Array, " m"] = eqx.field(converter=as_float)
    modulation: AbstractModulation

    def __check_init__(self):
        require_finite("torque", self.torque)
        for name in ("min_on_time", "opening_delay", "closing_delay"):
            require_positive(name, getattr(self, name), zero_allowed=True)

    @property
    def count(self) -> int:
        """How many thrusters there are."""
        return self.torque.shape[1]

    def on_times(
        self, duty: Float[Array, " m"], memory: PyTree, period: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, " m"], PyTree]:
        """What the duties of a period make: on-times (s) in it and in the next, and the memory.

        On-times are ∫ thrust dt over full thrust, as commanded.
        """
        pulses, memory = self.modulation(duty, memory, period, self.min_on_time)
        real = pulses.off > pulses.on
        on, off = pulses.on + self.opening_delay[None], pulses.off + self.closing_delay[None]

        def within(begin, end):
            length = jnp.clip(off, begin, end) - jnp.clip(on, begin, end)
            thrust = pulses.level * jnp.maximum(length, 0.0)
            return jnp.sum(jnp.where(real, thrust, 0.0), axis=0)

        return within(0.0, period), within(period, 2 * period), memory
