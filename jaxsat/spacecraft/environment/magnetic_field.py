"""The Earth's magnetic field along a circular orbit: a tilted dipole that turns with the Earth.

Wertz, Spacecraft Attitude Determination and Control, 1978, appendix H.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.trigonometry import cos, sin
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION, CircularOrbit

DIPOLE = (-1450.9e-9, 4652.5e-9, -29404.8e-9)
"""g11, h11 and g10 of IGRF-13 for 2020, T: the dipole in axes that turn with the Earth."""

REFERENCE_RADIUS = 6371.2e3
"""That of the IGRF, m."""


class DipoleField(eqx.Module):
    """The first degree of the IGRF along the circular `orbit`."""

    orbit: CircularOrbit

    def __call__(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """B at time `t` (s) in orbit axes, T: (R/r)³ (3 (m·r̂) r̂ - m) of the Earth's dipole m."""
        axes, angle = self.orbit.axes(t), self.orbit.sidereal_angle + EARTH_ROTATION * t
        east, north = cos(angle), sin(angle)
        x, y, z = DIPOLE
        m = axes @ jnp.stack([x * east - y * north, x * north + y * east, z + 0 * angle])
        up = jnp.array([0.0, 0.0, -1.0], m.dtype)
        return (REFERENCE_RADIUS / self.orbit.radius) ** 3 * (-3 * m[2] * up - m)

    def in_body(self, t: Float[Array, ""], attitude: AbstractAttitude) -> Float[Array, "3"]:
        """B at time `t` (s) in body axes, T."""
        return attitude.as_dcm().matrix @ self(t)
