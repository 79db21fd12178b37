"""Magnetorquers under the fault-tolerant law, which take momentum out of wheels."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.steering import MagneticSteering
from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float, require_positive
from jaxsat.spacecraft.dynamics import PlantState


class RodMemory(NamedTuple):
    """The torque (N m) of the last dipoles, and what magnetorquers make until the next sample.

    The latter is the mean over a period, in part of dipoles that were commanded before.
    """

    commanded: Float[Array, "3"]
    acting: Float[Array, "3"]

    @staticmethod
    def begin() -> "RodMemory":
        """No dipole has been commanded."""
        return RodMemory(jnp.zeros(3), jnp.zeros(3))


class TolerantRods(eqx.Module):
    """Magnetorquers, whose command is the dipole of each, A m².

    They make the part across the Earth's field of the torque that takes momentum out of wheels;
    other actuators make up for it, so that the body feels nothing of it. `steering` has their axes
    and limits, the field, and how fast momentum beyond a bias is to be taken out. Commands act
    `delay` (s) late. Nothing tells whether they work: no failure of theirs is diagnosed.
    """

    steering: MagneticSteering
    delay: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        require_positive("delay", self.delay, zero_allowed=True)

    @property
    def bias(self) -> Float[Array, "3"]:
        """The momentum (N m s, body axes) that wheels are to keep."""
        return self.steering.bias

    def field(self, t: RealScalar, state: PlantState) -> Float[Array, "3"]:
        """The Earth's field (T, body axes) at the attitude that the law is told."""
        return self.steering.field.in_body(t, state.attitude)

    def unload(
        self,
        field: Float[Array, "3"],
        excess: Float[Array, "3"],
        period: RealScalar,
        before: RodMemory,
    ) -> tuple[Float[Array, " k"], Float[Array, "3"], RodMemory]:
        """Dipoles (A m²) that lessen an excess of momentum (N m s) in a field (T), and their torque
        (N m)."""
        torque = -self.steering.unloading * excess
        dipoles, made = self.steering.within_limits(field, torque)
        late = self.delay * before.commanded + (period - self.delay) * made
        return dipoles, made, RodMemory(made, late / period)
