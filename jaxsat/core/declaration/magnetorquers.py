"""`[[magnetorquer]]`: declaration of magnetic coils and rods."""

from jaxsat.core.declaration.actuator import ActuatorDeclaration, Signal
from jaxsat.core.declaration.disturbances import needs_orbit
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, direction, number
from jaxsat.core.ranges import DIPOLE_LIMIT

MAGNETORQUER = ActuatorDeclaration(
    "magnetorquer",
    "one magnetorquer, a coil or rod",
    most=100,
    meaning="Magnetorquers, which make what the Earth's field allows of the torque that the law "
    "commands, or unload wheels",
    keys=(
        direction("axis", "Direction of its dipole, body axes"),
        number("dipole_limit_A_m2", "Largest dipole, either way", within=DIPOLE_LIMIT),
    ),
    failed="Whether it has failed before the start, and the law knows it",
    kinds=(
        FailureKind.DEAD,
        FailureKind.DEGRADED,
        FailureKind.STUCK_ON,
        FailureKind.STUCK_AT,
        FailureKind.REVERSED,
    ),
    idle=(FailureKind.DEAD, FailureKind.DEGRADED, FailureKind.REVERSED),
    drawn=tuple(FailureKind)[: FailureKind.LEAKING],
    both_signs=True,
    judged=True,
    steering="jaxsat.spacecraft.magnetorquers:MagneticSteering.from_tables",
    maker="jaxsat.spacecraft.magnetorquers:Magnetorquers.from_tables",
    rules=(needs_orbit("magnetorquer", "magnetorquers"),),
    dispersible=(
        DispersibleQuantity(
            "dipole_limit",
            "relative change of each magnetorquer's dipole limit",
            field="dipole_limit",
            within=DIPOLE_LIMIT,
            relative=True,
            axis="magnetorquer",
        ),
        DispersibleQuantity(
            "magnetorquer_misalignment",
            "turn of each magnetorquer towards two directions across it",
            "rad",
            axis="magnetorquer_turn",
        ),
    ),
    signals=(
        Signal(
            "dipole",
            "A m2",
            "dipole of each magnetorquer along its axis",
            peak=True,
            shape="rod",
            limit="dipole_limit_A_m2",
        ),
    ),
)
