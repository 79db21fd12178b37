"""Magnetorquers: coils or rods whose magnetic dipole turns the body in the Earth's field."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxsat.core.checks import as_float, require_positive
from jaxsat.spacecraft.axes import turned_axes, unit_axes
from jaxsat.spacecraft.failures import MagnetorquerFailures


class Magnetorquers(eqx.Module):
    """k magnetorquers along any axes, of shape (3, k) in body axes, scaled to unit length.

    `dipole_limit` (A m²), one number or one for each, bounds their dipoles, which follow a command
    at once. `failures` strike them in flight. Raises `ValueError` for an axis or a limit of zero.
    """

    axes: Float[Array, "3 k"]
    dipole_limit: Float[Array, " k"]
    failures: MagnetorquerFailures | None

    def __init__(
        self,
        axes: ArrayLike | list,
        dipole_limit: ArrayLike | list,
        failures: MagnetorquerFailures | None = None,
    ):
        self.axes = unit_axes(as_float(axes))
        self.dipole_limit = as_float(dipole_limit) * jnp.ones(self.count)
        self.failures = failures

    def __check_init__(self):
        require_positive("dipole_limit", self.dipole_limit)

    @property
    def count(self) -> int:
        """How many magnetorquers there are."""
        return self.axes.shape[1]

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When each failure strikes, s."""
        return jnp.zeros(0) if self.failures is None else self.failures.at

    def dipoles(
        self, command: Float[Array, " k"], struck: Bool[Array, " f"] | None = None
    ) -> Float[Array, " k"]:
        """The dipole of each on a command, A m², once the failures `struck` have struck."""
        made = jnp.clip(command, -self.dipole_limit, self.dipole_limit)
        if self.failures is None or struck is None:
            return made
        gain, level = self.failures.two_signed(struck, self.count)
        return gain * made + level * self.dipole_limit

    def misaligned(self, angles: Float[Array, "k 2"]) -> "Magnetorquers":
        """Magnetorquers turned by small angles (rad) towards two directions across each axis."""
        return eqx.tree_at(lambda one: one.axes, self, turned_axes(self.axes, angles))
