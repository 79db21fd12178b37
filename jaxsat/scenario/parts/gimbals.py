"""`[[gimbal]]`: single-gimbal control moment gyros."""

from typing import Annotated

import numpy as np

from jaxsat.core.declaration.failures import GimbalFailureKind
from jaxsat.core.ranges import RATE_RANGE, TURN, WHEEL_MOMENTUM
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.actuator import ActuatorDeclaration
from jaxsat.scenario.quantities import (
    Direction,
    Line,
    Number,
    ScenarioTable,
    Switch,
    choice,
    quantity,
    within,
)
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown

ACROSS = 1e-6
"""The cosine between a gimbal axis and its spin axis that counts as zero."""


class GimbalTable(ScenarioTable):
    """`[[gimbal]]`: one control moment gyro, a rotor of steady momentum in one gimbal."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    axis: Direction = quantity("Direction of its gimbal axis, body axes", "1")
    spin_axis: Direction = quantity(
        "Direction of its rotor's momentum at a gimbal angle of zero, across the gimbal axis", "1"
    )
    rotor_momentum_N_m_s: Annotated[Number, within(WHEEL_MOMENTUM)] = quantity(
        "Momentum of its rotor relative to the body", "N m s"
    )
    rate_limit_rad_s: Annotated[Number, within(RATE_RANGE)] = quantity(
        "Largest rate of its gimbal, either way", "rad/s"
    )
    angle_rad: Annotated[Number, within(TURN)] = quantity("Gimbal angle at the start", "rad", 0.0)
    failed: Switch = choice(
        "Whether its gimbal is locked from before the start, and the law knows it", False
    )


GIMBAL = ActuatorDeclaration(
    "gimbal",
    GimbalTable,
    100,
    "Control moment gyros, which make what they can of the torque that the law commands; wheels "
    "and thrusters make the rest",
    tuple(GimbalFailureKind),
    (GimbalFailureKind.LOCKED,),
    steered=True,
    maker="jaxsat.spacecraft.gimbals:ControlMomentGyros.from_tables",
)


@rule("gimbal")
def _rotors_spin_across_their_gimbals(gimbals):
    for number, one in enumerate(gimbals):
        axis, spin = np.array(one.axis, float), np.array(one.spin_axis, float)
        cosine = abs(axis @ spin) / np.sqrt((axis @ axis) * (spin @ spin))
        if cosine > ACROSS:
            message = f"must be perpendicular to axis = {shown(one.axis)}"
            yield Issue(("gimbal", number, "spin_axis"), f"{message}, got {shown(one.spin_axis)}")


@rule("gimbal", "wheel", "magnetorquer", "thruster", "spacecraft.thruster_torque_axes")
def _something_is_left(gimbals, wheels, magnetorquers, thrusters, axes):
    others = wheels or magnetorquers or thrusters or axes
    if gimbals and not others and all(one.failed for one in gimbals):
        message = "must leave one that works where there is no other actuator"
        yield at("gimbal", f"{message}, got {len(gimbals)} that have failed")
