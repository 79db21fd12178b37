"""`[[thruster]]`: declaration of one-sided thrusters."""

from jaxsat.core.declaration.actuator import ActuatorDeclaration, Signal
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, direction, number, switch
from jaxsat.core.ranges import FROM_ZERO, LENGTH, TORQUE_LIMIT, Range

FORCE = Range(1e-9, 1e9)
"""Range of a thruster's force, N."""

SPECIFIC_IMPULSE = Range(1.0, 1e5)
"""Range of the specific impulse, s; cold gas has 60, an ion engine some thousands."""

PRICE = Range(1e-3, 1e3)
"""Range of the price factor of a thruster's use."""

_KINDS = tuple(kind for kind in FailureKind if kind is not FailureKind.REVERSED)

THRUSTER = ActuatorDeclaration(
    "thruster",
    "one thruster, by its place and force or by its torque",
    most=1000,
    meaning="Thrusters that push, in place of those that make a torque of either sign",
    keys=(
        number(
            "position_m",
            "Where it sits, from the centre of mass, body axes; see spacecraft.centre_of_mass_m",
            within=LENGTH,
            size=3,
            default=None,
        ),
        direction("direction", "Direction of its force on the body, body axes", None),
        number("force_N", "Full thrust", within=FORCE, default=None),
        direction(
            "torque_axis",
            "Direction of its torque, body axes, in place of position and direction",
            None,
        ),
        number(
            "torque_N_m",
            "Torque at full thrust, in place of the force",
            within=TORQUE_LIMIT,
            default=None,
        ),
        switch(
            "two_sided",
            "Whether it is a pair that also pushes the other way, else it pushes one way only",
            False,
        ),
        number(
            "min_on_time_s",
            "Shortest time that its valve is open",
            within=FROM_ZERO,
            default=0.0,
        ),
        number("valve_delay_s", "Time from a command to the valve", within=FROM_ZERO, default=0.0),
        number(
            "rise_time_s",
            "Time from no thrust to full thrust, on a straight line",
            within=FROM_ZERO,
            default=0.0,
        ),
        number(
            "fall_time_s",
            "Time from full thrust to none, on a straight line",
            within=FROM_ZERO,
            default=0.0,
        ),
        number(
            "specific_impulse_s",
            "Specific impulse; by default its propellant is not counted",
            within=SPECIFIC_IMPULSE,
            default=None,
        ),
        number(
            "price",
            "Price of its use, times its propellant (times its torque where some thruster has no "
            "specific_impulse_s); of all that make a torque, jaxsat uses the cheapest thrusters",
            within=PRICE,
            default=1.0,
        ),
    ),
    failed="Whether it has failed before the start, and the law knows it",
    kinds=_KINDS,
    idle=_KINDS,
    judged=True,
    drawn=tuple(FailureKind)[: FailureKind.TURNED],
    dispersible=(
        DispersibleQuantity(
            "misalignment",
            "turn of each torque axis towards two directions across it",
            "rad",
            axis="thruster_turn",
        ),
        DispersibleQuantity(
            "torque_gain", "relative change of each thruster's torque", axis="thruster"
        ),
    ),
    signals=(
        Signal("thrust_level", "1", "mean thrust until the next time, over full thrust", mean=True),
        Signal(
            "propellant",
            "kg",
            "propellant used",
            each=False,
            total=True,
            overall="propellant (kg)",
            mute=True,
        ),
        Signal(
            "valve_openings",
            "1",
            "openings of each valve",
            total=True,
            overall="openings of all valves",
        ),
    ),
    numbered="; a two-sided one counts as two, of which only what is stuck or leaks strikes one",
)

IDEAL_KINDS = (
    FailureKind.DEAD,
    FailureKind.DEGRADED,
    FailureKind.STUCK_ON,
    FailureKind.STUCK_AT,
    FailureKind.TURNED,
    FailureKind.REVERSED,
)
"""Kinds of failure of the two-sided thrusters of `spacecraft.thruster_torque_axes`."""
