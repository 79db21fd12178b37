"""`[[flywheel]]`, as scenarios, studies and results know it; imports no JAX."""

from jaxsat.core.declaration import direction, number
from jaxsat.core.declaration.actuator import ActuatorDeclaration, Signal
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity

SHARE = number("share", "Part of its torque that is left", at_least=0, at_most=1, default=None)


class FlywheelFailureKind(AbstractFailureKind):
    """How a flywheel fails."""

    LOOSE = 0, "loose", "its motor makes no torque any more"
    WORN = 1, "worn", "its motor makes a share of its torque", SHARE


FLYWHEEL = ActuatorDeclaration(
    "flywheel",
    "one flywheel",
    most=8,
    meaning="Flywheels, which make what they can of the torque that the law commands",
    keys=(
        direction("axis", "Direction of its axis, body axes"),
        number("torque_limit_N_m", "Largest torque of its motor", "N m", above=0),
        number("momentum_limit_N_m_s", "Momentum that it should not pass", "N m s", above=0),
    ),
    failed="Whether its motor has failed before the start, and the law knows it",
    kinds=tuple(FlywheelFailureKind),
    idle=tuple(FlywheelFailureKind),
    drawn=tuple(FlywheelFailureKind),
    maker="flywheels.effector:Flywheels.from_tables",
    steering="flywheels.effector:FlywheelSteering.from_tables",
    dispersible=(
        DispersibleQuantity(
            "flywheel_momentum_start",
            "momentum at the start",
            "N m s",
            stage="start",
            axis="flywheel",
        ),
    ),
    signals=(
        Signal(
            "flywheel_momentum",
            "N m s",
            "flywheel momentum relative to the body",
            peak=True,
            overall="largest momentum of any flywheel (N m s)",
            shape="disc",
            limit="momentum_limit_N_m_s",
        ),
    ),
)
