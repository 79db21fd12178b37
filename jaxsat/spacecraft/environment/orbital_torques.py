"""Disturbances that depend on the orbital position: residual dipole, drag, solar pressure.

Wertz, Spacecraft Attitude Determination and Control, 1978, sections 5.1, 17.2 and appendix H.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_float, finite, not_negative, numpy_if_known, require_positive
from jaxsat.core.declaration import PartDeclaration
from jaxsat.core.declaration.disturbances import AERODYNAMIC, MAGNETIC, SOLAR
from jaxsat.core.earth import EARTH_RADIUS
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance, DisturbanceContext
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace, CircularOrbit
from jaxsat.spacecraft.environment.sensed_vectors import AbstractSensedVector

SOLAR_PRESSURE = 4.56e-6
"""Solar pressure on a surface that absorbs all light at 1 au, N/m²."""


class MagneticTorque(AbstractDisturbance):
    """Torque of a dipole fixed in the body (A m²) in the Earth's magnetic `field`."""

    declaration: ClassVar[PartDeclaration] = MAGNETIC

    dipole: Vector = eqx.field(converter=finite("dipole"))
    field: AbstractMagneticField

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "MagneticTorque | None":
        """Return the torque of a table of a scenario; None for no dipole."""
        dipole = values["residual_dipole_A_m2"]
        return cls(dipole, context.field) if any(dipole) else None

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return m × B in body axes, N m."""
        return jnp.cross(self.dipole, self.field.in_body(t, attitude))


class AerodynamicTorque(AbstractDisturbance):
    """Torque of drag: the force ½ ρ v² `coefficient` `area` against the velocity.

    `density` ρ in kg/m³ is constant, `area` in m², v the speed of the circular `orbit` (motion of
    the air is left out). The force acts at the `centre` of pressure, m from the centre of mass,
    body axes.
    """

    declaration: ClassVar[PartDeclaration] = AERODYNAMIC

    density: RealScalar = eqx.field(converter=not_negative("density"))
    coefficient: RealScalar = eqx.field(converter=not_negative("coefficient"))
    area: RealScalar = eqx.field(converter=not_negative("area"))
    centre: Vector = eqx.field(converter=finite("centre"))
    orbit: CircularOrbit

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "AerodynamicTorque | None":
        """Return the torque of a table of a scenario; None without air or with panels."""
        if not values["drag_density_kg_m3"] or context.panels:
            return None
        return cls(
            values["drag_density_kg_m3"],
            values["drag_coefficient"],
            values["drag_area_m2"],
            values["drag_centre_m"],
            context.circle,
        )

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return centre × force in body axes, N m."""
        forward = attitude.as_dcm().matrix[:, 0]
        speed = self.orbit.rate * self.orbit.radius
        force = -0.5 * self.density * speed**2 * self.coefficient * self.area * forward
        return jnp.cross(self.centre, force)


class Sunlight(AbstractSensedVector):
    """Direction and shadow of sunlight along an orbit: the Sun's direction is inertially fixed.

    `sun` is of any length but zero. With `eclipses` the Earth has a cylindrical shadow as wide as
    its equator, without light.
    """

    sun: Vector = eqx.field(converter=finite("sun"))
    orbit: AbstractPlace
    eclipses: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        xp, sun = numpy_if_known(self.sun)
        require_positive("sun", xp.sum(sun**2))

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: Any) -> "Sunlight":
        """Return the sunlight of a scenario's `SensorContext`."""
        return context.sunlight

    def __call__(self, t: RealScalar) -> tuple[Vector, RealScalar]:
        """Return the unit vector to the Sun, reference frame, at `t` (s), and the light, 0 or 1."""
        towards = self.orbit.axes(t) @ (self.sun / jnp.sqrt(jnp.sum(self.sun**2)))
        if not self.eclipses:
            return towards, jnp.ones_like(towards[2])
        depth = self.orbit.depth(t, towards)
        across = self.orbit.distance(t) ** 2 * (1 - depth**2)
        dark = (depth > 0) & (across < EARTH_RADIUS**2)
        return towards, jnp.where(dark, 0.0, 1.0)


class SolarPressureTorque(AbstractDisturbance):
    """Torque of solar pressure with one coefficient: the force P `coefficient` `area` from the Sun.

    `coefficient` is 1 for a surface that absorbs all light and 2 for a mirror that faces the Sun;
    `area` in m². The force acts at the `centre` of pressure, m from the centre of mass, body axes.
    `sun` is the direction to the Sun, fixed in inertial axes, of any length but zero; see
    `Sunlight` for `eclipses`.
    """

    declaration: ClassVar[PartDeclaration] = SOLAR

    coefficient: RealScalar = eqx.field(converter=not_negative("coefficient"))
    area: RealScalar = eqx.field(converter=not_negative("area"))
    centre: Vector = eqx.field(converter=finite("centre"))
    sun: Vector = eqx.field(converter=as_float)
    orbit: AbstractPlace
    eclipses: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        self.light()

    def light(self) -> Sunlight:
        """Return the direction and shadow of the light."""
        return Sunlight(self.sun, self.orbit, self.eclipses)

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "SolarPressureTorque | None":
        """Return the torque of a table of a scenario; None without area or with panels."""
        if not values["solar_area_m2"] or context.panels:
            return None
        return cls(
            values["solar_coefficient"],
            values["solar_area_m2"],
            values["solar_centre_m"],
            values["sun_direction"],
            context.place,
            values["eclipses"],
        )

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return centre × force in body axes, N m."""
        towards, light = self.light()(t)
        push = -light * SOLAR_PRESSURE * self.coefficient * self.area
        return jnp.cross(self.centre, push * (attitude.as_dcm().matrix @ towards))
