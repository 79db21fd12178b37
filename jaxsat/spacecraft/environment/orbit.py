"""Circular orbit, the rate of its LVLH frame, and the Earth's magnetic field along an orbit.

The orbit frame has x along the velocity, z towards the Earth's centre and y = z × x, minus the
orbit normal. It turns at (0, -ω0, 0) in its own axes. The field is that of a tilted dipole that
turns with the Earth (Wertz, Spacecraft Attitude Determination and Control, 1978, appendix H).
For the whole IGRF see `jaxsat.spacecraft.environment.igrf`.
"""

import abc

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.core.array_types import IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_float, finite, require_finite
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.core.trigonometry import cos, sin

EARTH_ROTATION = 7.292115e-5  # rad/s, WGS 84


class AbstractOrbit(eqx.Module):
    """Model of the orbit frame's own rotation in body axes."""

    rate: eqx.AbstractVar[RealScalar]

    @abc.abstractmethod
    def frame_rate(self, attitude: AbstractAttitude) -> Vector:
        """Return the rate of the orbit frame in body axes, rad/s: the term C_bo ω_e of (11)."""


class ExactOrbit(AbstractOrbit):
    """Exact form of equation (11): C (0, -ω0, 0)ᵀ. `rate` is ω0 in rad/s."""

    rate: RealScalar = eqx.field(converter=finite("rate"))

    def frame_rate(self, attitude: AbstractAttitude) -> Vector:
        """Return C (0, -ω0, 0)ᵀ, rad/s."""
        return -self.rate * attitude.as_dcm().matrix[:, 1]


class SmallAngleOrbit(AbstractOrbit):
    """Equation (11) with C_bo replaced by the identity, as in the paper's simulations."""

    rate: RealScalar = eqx.field(converter=finite("rate"))

    def frame_rate(self, attitude: AbstractAttitude) -> Vector:
        """Return (0, -ω0, 0)ᵀ, rad/s, for any attitude."""
        zero = jnp.zeros_like(self.rate)
        return jnp.stack([zero, -self.rate, zero])


class AbstractPlace(eqx.Module):
    """Position of a spacecraft along its orbit, and orientation of its reference frame."""

    sidereal_angle: eqx.AbstractVar[RealScalar]
    """Right ascension of Greenwich at time zero, rad."""

    @abc.abstractmethod
    def axes(self, t: RealScalar) -> Matrix:
        """Return the axes of the reference frame at time `t` (s), as rows, in inertial axes."""

    @abc.abstractmethod
    def up(self, t: RealScalar) -> Vector:
        """Return the unit vector from the Earth's centre at `t` (s), in the reference frame."""

    @abc.abstractmethod
    def depth(self, t: RealScalar, vector: Vector) -> RealScalar:
        """Return the component towards the Earth's centre of a vector in the reference frame."""

    @abc.abstractmethod
    def distance(self, t: RealScalar) -> RealScalar:
        """Return the distance from the Earth's centre at time `t` (s), m."""


class CircularOrbit(AbstractPlace):
    """A circular orbit in inertial axes with x to the equinox and z to the north pole.

    `rate` ω0 in rad/s determines the `radius`; at time zero the `inclination`, right ascension of
    the ascending `node`, `argument_of_latitude` of the spacecraft, and the `sidereal_angle` of
    Greenwich, rad. Node and plane are fixed.
    """

    rate: RealScalar = eqx.field(converter=as_float)
    inclination: RealScalar = eqx.field(converter=as_float, default=0.0)
    node: RealScalar = eqx.field(converter=as_float, default=0.0)
    argument_of_latitude: RealScalar = eqx.field(converter=as_float, default=0.0)
    sidereal_angle: RealScalar = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        names = ("rate", "inclination", "node", "argument_of_latitude", "sidereal_angle")
        for name in names:
            require_finite(name, getattr(self, name))

    @property
    def radius(self) -> RealScalar:
        """Radius (GM / ω0²)^⅓, m."""
        return jnp.cbrt(EARTH_GRAVITY / self.rate**2)

    def axes(self, t: RealScalar) -> Matrix:
        """Return the axes of the orbit frame at time `t` (s), as rows, in inertial axes."""
        along = self.argument_of_latitude + self.rate * t
        c, s, ci, si = cos(along), sin(along), cos(self.inclination), sin(self.inclination)
        cn, sn = cos(self.node), sin(self.node)
        up = jnp.stack([cn * c - sn * s * ci, sn * c + cn * s * ci, s * si])
        forward = jnp.stack([-cn * s - sn * c * ci, -sn * s + cn * c * ci, c * si])
        normal = jnp.stack([sn * si, -cn * si, ci])
        return jnp.stack([forward, -normal, -up])

    def up(self, t: RealScalar) -> Vector:
        """Return minus the third axis of the orbit frame."""
        return jnp.array([0.0, 0.0, -1.0], self.rate.dtype)

    def depth(self, t: RealScalar, vector: Vector) -> RealScalar:
        """Return the third component of a vector in orbit axes."""
        return vector[2]

    def distance(self, t: RealScalar) -> RealScalar:
        """Return the radius, m."""
        return self.radius


def place_on_circle(angle: RealScalar, count: int) -> tuple[IntScalar, RealScalar]:
    """Return the last of `count` equally spaced places on a circle up to an angle (rad), and the
    share of the way from there to the next."""
    place = angle * (count / (2 * np.pi))
    place = place - count * jnp.floor(place / count)
    low = jnp.clip(jnp.floor(place), 0, count - 1)  # round-off may leave the circle
    return low.astype(int), place - low


DIPOLE = (-1450.9e-9, 4652.5e-9, -29404.8e-9)
"""g11, h11 and g10 of IGRF-13 for 2020, T: the dipole in Earth-fixed axes."""

REFERENCE_RADIUS = 6371.2e3
"""Reference radius of the IGRF, m."""


class AbstractMagneticField(eqx.Module):
    """The Earth's magnetic field along an `orbit`, in the reference frame (orbit axes)."""

    orbit: eqx.AbstractVar[AbstractPlace]

    @property
    def circle(self) -> CircularOrbit:
        """The circular orbit; raises `ValueError` for another one."""
        if not isinstance(self.orbit, CircularOrbit):
            raise ValueError(f"Expected a circular orbit, but got {type(self.orbit).__name__}.")
        return self.orbit

    @property
    @abc.abstractmethod
    def dipole(self) -> Vector:
        """The first degree of the field as (g11, h11, g10), T."""

    @abc.abstractmethod
    def over(self, t: RealScalar, turn: RealScalar) -> Vector:
        """Return B in orbit axes, T, with the orbit at time `t` (s) and the Earth turned by `turn`
        (rad) since time zero: periodic in both."""

    @abc.abstractmethod
    def sampled(
        self, t: Float[np.ndarray, "*#shape"], turn: Float[np.ndarray, "*#shape"]
    ) -> Float[np.ndarray, "*both 3"]:
        """Return `over` for broadcast NumPy arrays, for tables, which XLA compiles too slowly."""

    def __call__(self, t: RealScalar) -> Vector:
        """Return B at time `t` (s) in orbit axes, T."""
        return self.over(t, EARTH_ROTATION * t)

    def in_body(self, t: RealScalar, attitude: AbstractAttitude) -> Vector:
        """Return B at time `t` (s) in body axes, T."""
        return attitude.as_dcm().matrix @ self(t)


class DipoleField(AbstractMagneticField):
    """The Earth's dipole m, the first degree of the IGRF: (R/r)³ (3 (m·r̂) r̂ - m)."""

    orbit: AbstractPlace

    @property
    def dipole(self) -> Vector:
        """The constant `DIPOLE`, T."""
        return as_float(DIPOLE)

    def over(self, t: RealScalar, turn: RealScalar) -> Vector:
        """Return B in orbit axes, T."""
        axes, angle = self.orbit.axes(t), self.orbit.sidereal_angle + turn
        east, north = cos(angle), sin(angle)
        x, y, z = DIPOLE
        m = axes @ jnp.stack([x * east - y * north, x * north + y * east, z + 0 * angle])
        up, distance = self.orbit.up(t), self.orbit.distance(t)
        return (REFERENCE_RADIUS / distance) ** 3 * (-3 * self.orbit.depth(t, m) * up - m)

    def sampled(
        self, t: Float[np.ndarray, "*#shape"], turn: Float[np.ndarray, "*#shape"]
    ) -> Float[np.ndarray, "*both 3"]:
        """Return B in orbit axes, T."""
        orbit = self.orbit
        if not isinstance(orbit, CircularOrbit):
            each = jnp.vectorize(self.over, signature="(),()->(n)")
            return np.asarray(each(jnp.asarray(t), jnp.asarray(turn)))
        along = float(orbit.argument_of_latitude) + float(orbit.rate) * t
        c, s, inclination = np.cos(along), np.sin(along), float(orbit.inclination)
        ci, si = np.cos(inclination), np.sin(inclination)
        angle = float(orbit.sidereal_angle) - float(orbit.node) + turn
        x, y, z = DIPOLE
        east, north = np.cos(angle), np.sin(angle)
        ascending, across = x * east - y * north, x * north + y * east
        within, normal = across * ci + z * si, z * ci - across * si
        forward, up = within * c - ascending * s, ascending * c + within * s
        size = REFERENCE_RADIUS**3 * float(orbit.rate) ** 2 / EARTH_GRAVITY
        return size * np.stack(np.broadcast_arrays(-forward, normal, -2 * up), axis=-1)
