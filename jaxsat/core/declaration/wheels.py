"""`[[wheel]]`: declaration of reaction wheels."""

from jaxsat.core.declaration.actuator import ActuatorDeclaration, Signal
from jaxsat.core.declaration.failures import FRACTION, AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, direction, number
from jaxsat.core.declaration.sensor import outage
from jaxsat.core.ranges import (
    FRICTION,
    MOMENT,
    SECONDS,
    TORQUE,
    TORQUE_LIMIT,
    WHEEL_MOMENTUM,
    WHEEL_NOISE,
)

FACTOR = number(
    "factor", "Factor on its viscous and Coulomb friction", within=FRICTION, default=None
)
FRICTION_N_M = number(
    "friction_N_m",
    "Coulomb friction that it now has, if it had less",
    within=FRICTION,
    default=None,
)


class WheelFailureKind(AbstractFailureKind):
    """Kinds of failure of a reaction wheel."""

    DEAD = 0, "dead", "its motor makes no torque any more, it coasts"
    DEGRADED = 1, "degraded", "its motor makes a fraction of the torque that it should", FRACTION
    STOPPED = 2, "stopped", "it stands still at once, its momentum goes to the body"
    FRICTION_BY = 3, "friction-up", "viscous and Coulomb friction times factor", FACTOR
    FRICTION_TO = 4, "friction-up", "Coulomb friction at least friction_N_m", FRICTION_N_M
    RUNAWAY = 5, "runaway", "full torque, the way that it turns, the positive one from rest"


WHEEL = ActuatorDeclaration(
    "wheel",
    "one reaction wheel",
    most=100,
    meaning="Reaction wheels, which make what they can of the torque that the law commands; "
    "thrusters make the rest",
    keys=(
        direction("axis", "Direction of its axis, body axes"),
        number(
            "torque_limit_N_m",
            "Largest torque of its motor; by default unlimited",
            within=TORQUE_LIMIT,
            default=None,
        ),
        number(
            "momentum_limit_N_m_s",
            "Largest momentum relative to the body; by default unlimited",
            within=WHEEL_MOMENTUM,
            default=None,
        ),
        number(
            "momentum_N_m_s",
            "Momentum relative to the body at the start",
            within=TORQUE,
            default=0.0,
        ),
        number(
            "rotor_inertia_kg_m2",
            "Inertia of its rotor about the axis, part of spacecraft.inertia_kg_m2; its momentum "
            "then also changes as the body turns faster, and viscous friction needs it. Without "
            "it, 0 is assumed: the momentum changes by motor and friction alone",
            within=MOMENT,
            default=None,
        ),
        number(
            "viscous_friction_N_m_s",
            "Viscous friction, for each rad/s of the rotor",
            within=FRICTION,
            default=0.0,
        ),
        number(
            "coulomb_friction_N_m",
            "Coulomb friction, which may hold the rotor at rest",
            within=FRICTION,
            default=0.0,
        ),
        number(
            "tachometer_noise_N_m_s",
            "Standard deviation of white noise on the momentum that a sampled law receives, per "
            "sample",
            within=WHEEL_NOISE,
            default=0.0,
        ),
        *outage(
            "tachometer",
            start=SECONDS,
            prefix="tachometer_",
            effect="the momentum that a sampled law receives is invalid",
        ),
    ),
    failed="Whether its motor has failed before the start, and the law knows it; it coasts",
    kinds=tuple(WheelFailureKind),
    idle=(WheelFailureKind.DEAD, WheelFailureKind.DEGRADED),
    drawn=tuple(WheelFailureKind),
    judged=True,
    maker="jaxsat.spacecraft.wheels:Wheels.from_tables",
    dispersible=(
        DispersibleQuantity(
            "rotor_inertia",
            "relative change of the rotor inertia of each wheel, which the law does not know; "
            "that of the whole body stays",
            field="rotor_inertia",
            within=MOMENT,
            relative=True,
            stage="body",
            axis="wheel",
        ),
        DispersibleQuantity(
            "wheel_momentum",
            "initial momentum of each wheel relative to the body",
            "N m s",
            stage="start",
            axis="wheel",
        ),
    ),
    signals=(
        Signal(
            "wheel_momentum",
            "N m s",
            "wheel momentum relative to the body",
            peak=True,
            overall="largest momentum of any wheel (N m s)",
            shape="disc",
            limit="momentum_limit_N_m_s",
        ),
        Signal("wheel_torque", "N m", "wheel torque on the body along its axis"),
    ),
    momentum=("momentum_N_m_s", "wheel_momentum"),
)
