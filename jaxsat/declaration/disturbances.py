"""The disturbances that come with jaxsat, whose keys stand in `[disturbance]` itself."""

from jaxsat.declaration.keys import number, switch
from jaxsat.declaration.part import PartDeclaration
from jaxsat.ranges import ANGLE, FREQUENCY, TORQUE, Range

_ZERO = (0.0, 0.0, 0.0)


def _vector(name: str, meaning: str, unit: str, values: Range):
    low, high = values
    return number(name, meaning, unit, at_least=low, at_most=high, size=3, default=_ZERO)


PERIODIC = PartDeclaration(
    "the periodic torque (2)",
    (
        _vector("amplitude_N_m", "Amplitudes of the periodic torque (2)", "N m", TORQUE),
        _vector("frequency_rad_s", "Frequencies Ω of the periodic torque (2)", "rad/s", FREQUENCY),
        _vector("phase_rad", "Phases of the periodic torque", "rad", ANGLE),
    ),
)
CONSTANT = PartDeclaration(
    "a torque fixed in body axes",
    (_vector("constant_N_m", "Torque fixed in body axes", "N m", TORQUE),),
)
GRAVITY_GRADIENT = PartDeclaration(
    "the gravity-gradient torque",
    (switch("gravity_gradient", "Whether the gravity-gradient torque acts", False),),
)

DISTURBANCES = {
    "jaxsat.environment.disturbances:PeriodicTorque": PERIODIC,
    "jaxsat.environment.disturbances:ConstantTorque": CONSTANT,
    "jaxsat.environment.disturbances:GravityGradient": GRAVITY_GRADIENT,
}
"""Declarations by the place of the class."""
