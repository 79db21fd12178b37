"""Drag and solar pressure on flat plates.

Wertz, Spacecraft Attitude Determination and Control, 1978, section 17.2.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_float, finite, not_negative, numpy_if_known, require_positive
from jaxsat.core.declaration import PartDeclaration
from jaxsat.core.declaration.disturbances import PANEL_DRAG, PANEL_LIGHT
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance, DisturbanceContext
from jaxsat.spacecraft.environment.orbit import CircularOrbit
from jaxsat.spacecraft.environment.orbital_torques import SOLAR_PRESSURE, Sunlight


class Panels(eqx.Module):
    """P flat plates that air and light strike on the side of their normals, in body axes.

    `area` in m²; `normal` outwards, of any length but zero; `centre` of each in m from the centre
    of mass; `drag_coefficient`; and the reflected shares of light, `specular` and `diffuse`, of
    which the rest is absorbed. Plates do not shadow each other. Raises `ValueError` for numbers
    outside their ranges.
    """

    area: Float[Array, " p"] = eqx.field(converter=not_negative("area"))
    normal: Float[Array, "p 3"] = eqx.field(converter=as_float)
    centre: Float[Array, "p 3"] = eqx.field(converter=finite("centre"))
    drag_coefficient: Float[Array, " p"] = eqx.field(converter=not_negative("drag_coefficient"))
    specular: Float[Array, " p"] = eqx.field(converter=not_negative("specular"))
    diffuse: Float[Array, " p"] = eqx.field(converter=not_negative("diffuse"))

    def __check_init__(self):
        xp, normal = numpy_if_known(self.normal)
        require_positive("normal", xp.sum(normal**2, axis=1))

    @classmethod
    def from_tables(cls, tables: Sequence[Any]) -> "Panels":
        """Return the panels of checked tables `[[panel]]` of a scenario."""
        names = ("area_m2", "normal", "centre_m", "drag_coefficient", "specular", "diffuse")
        return cls(*(np.array([getattr(one, name) for one in tables]) for name in names))

    def unit_normals(self) -> Float[Array, "p 3"]:
        """Return the normals scaled to unit length."""
        return self.normal / jnp.sqrt(jnp.sum(self.normal**2, axis=1, keepdims=True))

    def torque(self, force: Float[Array, "p 3"]) -> Vector:
        """Return the torque of a force (N) on the centre of each panel, N m."""
        return jnp.sum(jnp.cross(self.centre, force), axis=0)


class PanelDrag(AbstractDisturbance):
    """Drag on `panels`: -½ ρ v² C_d A (n·v̂) v̂ on each that faces the velocity.

    `density` ρ in kg/m³ is constant, v the speed of the circular `orbit` (motion of the air is
    left out).
    """

    declaration: ClassVar[PartDeclaration] = PANEL_DRAG

    density: RealScalar = eqx.field(converter=not_negative("density"))
    panels: Panels
    orbit: CircularOrbit

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "PanelDrag | None":
        """Return the torque on the panels of a scenario; None without air or panels."""
        density = values["drag_density_kg_m3"]
        if not density or not context.panels:
            return None
        return cls(density, Panels.from_tables(context.panels), context.circle)

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return Σ centre × force in body axes, N m."""
        panels, forward = self.panels, attitude.as_dcm().matrix[:, 0]
        speed = self.orbit.rate * self.orbit.radius
        facing = jnp.maximum(panels.unit_normals() @ forward, 0.0)
        size = 0.5 * self.density * speed**2 * panels.drag_coefficient * panels.area * facing
        return panels.torque(-size[:, None] * forward[None])


class PanelSolarPressure(AbstractDisturbance):
    """Light on `panels`: -P A cosθ ((1 - C_s) ŝ + 2 (C_s cosθ + C_d / 3) n) on each that is lit.

    ŝ points to the Sun, cosθ = n·ŝ, C_s and C_d are the specularly and diffusely reflected shares
    of light.
    """

    declaration: ClassVar[PartDeclaration] = PANEL_LIGHT

    panels: Panels
    light: Sunlight

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "PanelSolarPressure | None":
        """Return the torque on the panels of a scenario; None without panels."""
        if not context.panels:
            return None
        light = Sunlight(values["sun_direction"], context.place, values["eclipses"])
        return cls(Panels.from_tables(context.panels), light)

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return Σ centre × force in body axes, N m."""
        panels, normal = self.panels, self.panels.unit_normals()
        towards, pressure = self.light(t)
        sun = attitude.as_dcm().matrix @ towards
        cosine = jnp.maximum(normal @ sun, 0.0)
        along_normal = 2 * (panels.specular * cosine + panels.diffuse / 3)
        push = (1 - panels.specular)[:, None] * sun[None] + along_normal[:, None] * normal
        size = pressure * SOLAR_PRESSURE * panels.area * cosine
        return panels.torque(-size[:, None] * push)
