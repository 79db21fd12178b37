"""Circular orbit and the rate of its LVLH frame.

The orbit frame has x along the velocity, z towards the Earth's centre and y = z × x, minus the
orbit normal. It turns at (0, -ω0, 0) in its own axes.
"""

import abc
import math

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.attitude import AbstractAttitude
from jaxsat.checks import as_float, require_finite

EARTH_GRAVITY = 3.986004418e14  # m³/s², WGS 84
EARTH_RADIUS = 6378137.0  # m, equatorial, WGS 84


def circular_orbit_rate(altitude: float) -> float:
    """Two-body angular rate ω0 of a circular orbit around the Earth, rad/s; `altitude` in m."""
    if not altitude > -EARTH_RADIUS:
        raise ValueError(
            f"Argument `altitude` must be above the Earth's centre, but got {altitude}."
        )
    return math.sqrt(EARTH_GRAVITY / (EARTH_RADIUS + altitude) ** 3)


class AbstractOrbit(eqx.Module):
    """How the orbit frame's own rotation appears in body axes."""

    rate: eqx.AbstractVar[Float[Array, ""]]

    @abc.abstractmethod
    def frame_rate(self, attitude: AbstractAttitude) -> Float[Array, "3"]:
        """Angular velocity of the orbit frame in body axes, rad/s: the term C_bo ω_e of (11)."""


class ExactOrbit(AbstractOrbit):
    """Equation (11) as it is: C (0, -ω0, 0)ᵀ. `rate` is ω0 in rad/s."""

    rate: Float[Array, ""] = eqx.field(converter=as_float)

    def __check_init__(self):
        require_finite("rate", self.rate)

    def frame_rate(self, attitude: AbstractAttitude) -> Float[Array, "3"]:
        """C (0, -ω0, 0)ᵀ, rad/s."""
        return -self.rate * attitude.as_dcm().matrix[:, 1]


class SmallAngleOrbit(AbstractOrbit):
    """Equation (11) with C_bo replaced by the identity, as in the paper's simulations."""

    rate: Float[Array, ""] = eqx.field(converter=as_float)

    def __check_init__(self):
        require_finite("rate", self.rate)

    def frame_rate(self, attitude: AbstractAttitude) -> Float[Array, "3"]:
        """(0, -ω0, 0)ᵀ whatever the attitude, rad/s."""
        del attitude
        zero = jnp.zeros_like(self.rate)
        return jnp.stack([zero, -self.rate, zero])
