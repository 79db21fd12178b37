"""Disturbances that come with jaxsat, whose keys are in `[disturbance]` itself."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.keys import (
    DispersibleQuantity,
    Finding,
    PartDeclaration,
    Rule,
    number,
    switch,
)
from jaxsat.core.ranges import ANGLE, DIPOLE, FREQUENCY, LENGTH, TORQUE, Range

RATE_AT_GROUND = 0.00124
"""Rate of a circular orbit at the Earth's surface, rad/s."""


def needs_orbit(key: str, what: str) -> Rule:
    """Return the rule of an orbit above the ground unless `key` is zero or empty."""

    def check(rate: float | None, value: Any) -> Iterator[Finding]:
        acts = any(value) if isinstance(value, tuple) else value
        if acts and rate is not None and not 0 < rate <= RATE_AT_GROUND:
            yield Finding(
                "orbit.rate_rad_s",
                "must be that of an orbit above the ground, greater than 0 and at most "
                f"{RATE_AT_GROUND:g} rad/s, with {what}, got {rate}",
            )

    return Rule(("orbit.rate_rad_s", key), check)


_ZERO = (0.0, 0.0, 0.0)


def _vector(name: str, meaning: str, unit: str, values: Range):
    return number(name, meaning, unit, within=values, size=3, default=_ZERO)


PERIODIC = PartDeclaration(
    "the periodic torque (2)",
    (
        _vector("amplitude_N_m", "Amplitudes of the periodic torque (2)", "N m", TORQUE),
        _vector("frequency_rad_s", "Frequencies Ω of the periodic torque (2)", "rad/s", FREQUENCY),
        _vector("phase_rad", "Phases of the periodic torque", "rad", ANGLE),
    ),
    (
        DispersibleQuantity(
            "disturbance_amplitude",
            "relative change of the periodic torque's amplitudes",
            axis="body_axis",
            field="amplitude",
            within=TORQUE,
            relative=True,
        ),
        DispersibleQuantity(
            "disturbance_frequency",
            "relative change of the periodic torque's frequencies",
            axis="body_axis",
            field="frequency",
            within=FREQUENCY,
            relative=True,
        ),
        DispersibleQuantity(
            "disturbance_phase",
            "phases of the periodic torque",
            "rad",
            axis="body_axis",
            field="phase",
            within=ANGLE,
        ),
    ),
)
CONSTANT = PartDeclaration(
    "a torque fixed in body axes",
    (_vector("constant_N_m", "Torque fixed in body axes", "N m", TORQUE),),
    (
        DispersibleQuantity(
            "constant_torque", "torque to add, fixed in body axes", "N m", axis="body_axis"
        ),
    ),
)
GRAVITY_GRADIENT = PartDeclaration(
    "the gravity-gradient torque",
    (switch("gravity_gradient", "Whether the gravity-gradient torque acts", False),),
)
MAGNETIC = PartDeclaration(
    "the torque on a residual dipole in the field of a tilted dipole that turns with the Earth",
    (_vector("residual_dipole_A_m2", "Magnetic dipole fixed in body axes", "A m²", DIPOLE),),
    rules=(needs_orbit("disturbance.residual_dipole_A_m2", "a residual dipole"),),
)
AERODYNAMIC = PartDeclaration(
    "the torque of drag, by one coefficient and the speed of the orbit",
    (
        number(
            "drag_density_kg_m3", "Density of the air", "kg/m³", at_least=0, at_most=1, default=0.0
        ),
        number("drag_coefficient", "Drag coefficient", at_least=0, at_most=100, default=2.2),
        number("drag_area_m2", "Area across the velocity", at_least=0, at_most=1e6, default=1.0),
        _vector("drag_centre_m", "Centre of pressure from the centre of mass", "m", LENGTH),
    ),
    rules=(needs_orbit("disturbance.drag_density_kg_m3", "drag"),),
)
SOLAR = PartDeclaration(
    "the torque of sunlight, by one coefficient",
    (
        number("solar_area_m2", "Area across the sunlight", at_least=0, at_most=1e6, default=0.0),
        number(
            "solar_coefficient",
            "1 for a surface that absorbs all light, 2 for a mirror",
            at_least=0,
            at_most=2,
            default=1.5,
        ),
        _vector("solar_centre_m", "Centre of pressure from the centre of mass", "m", LENGTH),
        number(
            "sun_direction",
            "Direction to the Sun in inertial axes, of any length but zero",
            at_least=-1e6,
            at_most=1e6,
            size=3,
            default=(1.0, 0.0, 0.0),
        ),
        switch("eclipses", "Whether the Earth has a shadow, a cylinder", False),
    ),
    rules=(needs_orbit("disturbance.eclipses", "eclipses"),),
)
PANEL_DRAG = PartDeclaration("the torque of drag on panels")
PANEL_LIGHT = PartDeclaration("the torque of sunlight on panels")

DISTURBANCES = {
    "jaxsat.spacecraft.environment.disturbances:PeriodicTorque": PERIODIC,
    "jaxsat.spacecraft.environment.disturbances:ConstantTorque": CONSTANT,
    "jaxsat.spacecraft.environment.disturbances:GravityGradient": GRAVITY_GRADIENT,
    "jaxsat.spacecraft.environment.orbital_torques:MagneticTorque": MAGNETIC,
    "jaxsat.spacecraft.environment.orbital_torques:AerodynamicTorque": AERODYNAMIC,
    "jaxsat.spacecraft.environment.orbital_torques:SolarPressureTorque": SOLAR,
    "jaxsat.spacecraft.environment.panels:PanelDrag": PANEL_DRAG,
    "jaxsat.spacecraft.environment.panels:PanelSolarPressure": PANEL_LIGHT,
}
"""Declarations by the import path of the class."""
