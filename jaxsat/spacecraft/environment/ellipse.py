"""Elliptic orbit with the secular rates from the Earth's oblateness."""

import equinox as eqx
import jax.numpy as jnp

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, not_negative, positive, require_finite, require_positive
from jaxsat.core.earth import EARTH_GRAVITY, EARTH_RADIUS
from jaxsat.core.trigonometry import cos, sin
from jaxsat.spacecraft.environment.orbit import AbstractPlace

NEWTON_STEPS = 6
"""Steps to an eccentric anomaly within 1e-14 of the exact one up to `MAX_ECCENTRICITY`."""


def eccentric_anomaly(mean: RealScalar, eccentricity: RealScalar) -> RealScalar:
    """Solve Kepler's equation E - e sin E = M for E, rad, for M (rad) from -π to π.

    A fixed number of Newton's steps, which can be differentiated, from M + e sin M / (1 - sin(M +
    e) + sin M) (Prussing and Conway, Orbital Mechanics, 1993, section 2.2) for |M|.
    """
    size = jnp.abs(mean)
    sine = sin(size)
    angle = size + eccentricity * sine / (1 - sin(size + eccentricity) + sine)
    for _ in range(NEWTON_STEPS):
        excess = angle - eccentricity * sin(angle) - size
        angle = angle - excess / (1 - eccentricity * cos(angle))
    return jnp.where(mean < 0, -angle, angle)


class EllipticOrbit(AbstractPlace):
    """An elliptic orbit. The reference frame of attitudes is the inertial one.

    Mean elements at time zero: `semi_major_axis` in m, `eccentricity` up to 0.9, and in rad
    `inclination`, right ascension of the ascending `node`, `argument_of_perigee`, `mean_anomaly`,
    and the `sidereal_angle` of Greenwich. `oblateness` is J2, by which node, perigee and mean
    anomaly move at their secular rates (Vallado, Fundamentals of Astrodynamics and Applications,
    2013, section 9.6); zero gives Kepler's ellipse. Periodic terms of J2, drag and third bodies
    are left out. Raises `ValueError` for an orbit that is not an ellipse.
    """

    semi_major_axis: RealScalar = eqx.field(converter=positive("semi_major_axis"))
    eccentricity: RealScalar = eqx.field(converter=not_negative("eccentricity"))
    inclination: RealScalar = eqx.field(converter=as_float, default=0.0)
    node: RealScalar = eqx.field(converter=as_float, default=0.0)
    argument_of_perigee: RealScalar = eqx.field(converter=as_float, default=0.0)
    mean_anomaly: RealScalar = eqx.field(converter=as_float, default=0.0)
    sidereal_angle: RealScalar = eqx.field(converter=as_float, default=0.0)
    oblateness: RealScalar = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self):
        require_positive("1 - eccentricity", 1 - self.eccentricity)
        angles = ("inclination", "node", "argument_of_perigee", "mean_anomaly", "sidereal_angle")
        for name in (*angles, "oblateness"):
            require_finite(name, getattr(self, name))

    def secular_rates(self) -> tuple[RealScalar, RealScalar, RealScalar]:
        """Return the secular rates of node, argument of perigee and mean anomaly, rad/s."""
        axis, inclination = self.semi_major_axis, self.inclination
        motion = jnp.sqrt(EARTH_GRAVITY / axis) / axis
        square = 1 - self.eccentricity**2
        size = 1.5 * self.oblateness * motion * (EARTH_RADIUS / (axis * square)) ** 2
        across = 1 - 1.5 * sin(inclination) ** 2
        perigee = size * (2 - 2.5 * sin(inclination) ** 2)
        return -size * cos(inclination), perigee, motion + size * jnp.sqrt(square) * across

    def position(self, t: RealScalar) -> Vector:
        """Return the position from the Earth's centre in inertial axes at time `t` (s), m."""
        node_rate, perigee_rate, motion = self.secular_rates()
        mean = self.mean_anomaly + motion * t
        mean = mean - 2 * jnp.pi * jnp.round(mean / (2 * jnp.pi))
        angle, e = eccentric_anomaly(mean, self.eccentricity), self.eccentricity
        x = self.semi_major_axis * (cos(angle) - e)
        y = self.semi_major_axis * jnp.sqrt(1 - e**2) * sin(angle)
        perigee = self.argument_of_perigee + perigee_rate * t
        c, s, ci, si = cos(perigee), sin(perigee), cos(self.inclination), sin(self.inclination)
        node = self.node + node_rate * t
        cn, sn = cos(node), sin(node)
        to_node, across = x * c - y * s, x * s + y * c
        return jnp.stack(
            [cn * to_node - sn * across * ci, sn * to_node + cn * across * ci, across * si]
        )

    def axes(self, t: RealScalar) -> Matrix:
        """Return the identity: the reference axes are the inertial ones."""
        return jnp.eye(3, dtype=self.semi_major_axis.dtype)

    def up(self, t: RealScalar) -> Vector:
        """Return the unit vector away from the Earth's centre, in inertial axes."""
        return self.position(t) / self.distance(t)

    def depth(self, t: RealScalar, vector: Vector) -> RealScalar:
        """Return the component towards the Earth's centre of a vector in inertial axes."""
        return -jnp.sum(self.up(t) * vector)

    def distance(self, t: RealScalar) -> RealScalar:
        """Return the distance from the Earth's centre at time `t` (s), m."""
        return jnp.sqrt(jnp.sum(self.position(t) ** 2))
