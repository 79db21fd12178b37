"""Thrusters that push: where they sit, what torque and force each makes, how its valve behaves."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.checks import (
    as_float,
    as_optional_float,
    concrete,
    require_finite,
    require_positive,
)
from jaxsat.spacecraft.axes import turned_axes


class ThrusterSet(eqx.Module):
    """m thrusters, each of which pushes one way: its thrust is between zero and full.

    At full thrust thruster k makes the torque `torque`[:, k] (N m) and the force `force`[:, k] (N)
    on the body, both in body axes, and uses `flow`[k] (kg/s) of propellant. Its valve opens for
    `min_on_time`[k] (s) at least. `valve_delay` (s) is the time from a command to the valve, and
    thrust rises and falls in straight lines that take `rise_time` and `fall_time` (s) from zero to
    full and back; None is a set in which all of these are zero. Raises `ValueError` for a torque
    that is zero or not finite, and for times or flows below zero.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=as_float)
    force: Float[Array, "3 m"] = eqx.field(converter=as_float)
    flow: Float[Array, " m"] = eqx.field(converter=as_float)
    min_on_time: Float[Array, " m"] = eqx.field(converter=as_float)
    valve_delay: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)
    rise_time: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)
    fall_time: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)

    def __check_init__(self):
        require_finite("torque", self.torque)
        require_finite("force", self.force)
        known = concrete(self.torque)
        if known is not None and not np.all(np.any(known != 0, axis=0)):
            raise ValueError("Argument `torque` must have no zero column, but one is zero.")
        if (self.rise_time is None) != (self.fall_time is None):
            raise ValueError("Arguments `rise_time` and `fall_time` must be given together.")
        for name in ("flow", "min_on_time", "valve_delay", "rise_time", "fall_time"):
            value = getattr(self, name)
            if value is not None:
                require_positive(name, value, zero_allowed=True)

    @property
    def count(self) -> int:
        """How many thrusters there are."""
        return self.torque.shape[1]

    @property
    def ramps(self) -> bool:
        """Whether thrust takes time to rise and fall."""
        return self.rise_time is not None

    def misaligned(self, angles: Float[Array, "m 2"]) -> "ThrusterSet":
        """Thrusters whose torques are turned by small angles (rad) towards two directions across.

        Their forces stay. The tangents of the angles are taken as small.
        """
        size = jnp.sqrt(jnp.sum(self.torque**2, axis=0))
        turned = turned_axes(self.torque / size[None], angles)
        return eqx.tree_at(lambda one: one.torque, self, turned * size[None])

    def stronger(self, change: Float[Array, " m"]) -> "ThrusterSet":
        """Thrusters that make 1 + `change` of their torque and force at the same flow."""
        return eqx.tree_at(
            lambda one: (one.torque, one.force),
            self,
            (self.torque * (1 + change)[None], self.force * (1 + change)[None]),
        )
