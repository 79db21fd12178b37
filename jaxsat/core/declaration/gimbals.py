"""`[[gimbal]]`: declaration of single-gimbal control moment gyros."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

from jaxsat.core.declaration.actuator import ActuatorDeclaration, Signal
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, Finding, Rule, direction, number
from jaxsat.core.ranges import RATE_RANGE, SECONDS, TURN, WHEEL_MOMENTUM

ACROSS = 1e-6
"""Tolerance on the cosine between a gimbal axis and its spin axis."""

TIME_CONSTANT = number(
    "time_constant_s", "Time in which its momentum falls to 1/e", within=SECONDS, default=None
)


class GimbalFailureKind(AbstractFailureKind):
    """Kinds of failure of a control moment gyro."""

    LOCKED = 0, "locked", "its gimbal keeps its angle"
    RUN_DOWN = (
        1,
        "run-down",
        "its rotor's momentum falls to 1/e in every time_constant_s",
        TIME_CONSTANT,
    )


def _rotors_spin_across_their_gimbals(gimbals: Sequence[Any]) -> Iterator[Finding]:
    for place, one in enumerate(gimbals):
        product = sum(a * b for a, b in zip(one.axis, one.spin_axis, strict=True))
        if abs(product) > ACROSS * math.hypot(*one.axis) * math.hypot(*one.spin_axis):
            message = f"must be perpendicular to axis = {list(one.axis)}"
            yield Finding(f"gimbal.{place}.spin_axis", f"{message}, got {list(one.spin_axis)}")


GIMBAL = ActuatorDeclaration(
    "gimbal",
    "one control moment gyro, a rotor of steady momentum in one gimbal",
    most=100,
    meaning="Control moment gyros, which make what they can of the torque that the law commands; "
    "wheels and thrusters make the rest",
    keys=(
        direction("axis", "Direction of its gimbal axis, body axes"),
        direction(
            "spin_axis",
            "Direction of its rotor's momentum at a gimbal angle of zero, across the gimbal axis",
        ),
        number(
            "rotor_momentum_N_m_s",
            "Momentum of its rotor relative to the body",
            within=WHEEL_MOMENTUM,
        ),
        number("rate_limit_rad_s", "Largest rate of its gimbal, either way", within=RATE_RANGE),
        number("angle_rad", "Gimbal angle at the start", within=TURN, default=0.0),
    ),
    failed="Whether its gimbal is locked from before the start, and the law knows it",
    kinds=tuple(GimbalFailureKind),
    idle=(GimbalFailureKind.LOCKED,),
    drawn=tuple(GimbalFailureKind),
    steering="jaxsat.spacecraft.gimbals:GimbalSteering.from_tables",
    maker="jaxsat.spacecraft.gimbals:ControlMomentGyros.from_tables",
    rules=(Rule(("gimbal",), _rotors_spin_across_their_gimbals),),
    dispersible=(
        DispersibleQuantity(
            "rotor_momentum",
            "relative change of the momentum of each control moment gyro's rotor",
            axis="gimbal",
        ),
    ),
    signals=(
        Signal("gimbal_angle", "rad", "angle of each gimbal"),
        Signal("gimbal_rate", "rad s-1", "rate of each gimbal", peak=True),
    ),
    called="control moment gyro",
    momentum=("rotor_momentum_N_m_s", "rotor_momentum"),
)
