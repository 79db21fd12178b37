"""`[[magnetorquer]]`, `[unloading]`: dipoles in the Earth's field."""

from typing import Annotated

from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.ranges import DIPOLE_LIMIT, SECONDS
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


class MagnetorquerTable(ScenarioTable):
    """`[[magnetorquer]]`: one magnetorquer, a coil or rod."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    axis: Direction = quantity("Direction of its dipole, body axes", "1")
    dipole_limit_A_m2: Annotated[Number, within(DIPOLE_LIMIT)] = quantity(
        "Largest dipole, either way", "A m²"
    )
    failed: Switch = choice("Whether it has failed before the start, and the law knows it", False)


class UnloadingTable(ScenarioTable):
    """`[unloading]`: how magnetorquers take momentum out of wheels."""

    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time in which the wheels' momentum across the Earth's field is to fall to 1/e", "s", 1000.0
    )


MAGNETORQUER = ActuatorDeclaration(
    "magnetorquer",
    MagnetorquerTable,
    100,
    "Magnetorquers, which make what the Earth's field allows of the torque that the law commands, "
    "or unload wheels",
    (
        FailureKind.DEAD,
        FailureKind.DEGRADED,
        FailureKind.STUCK_ON,
        FailureKind.STUCK_AT,
        FailureKind.REVERSED,
    ),
    (FailureKind.DEAD, FailureKind.DEGRADED, FailureKind.REVERSED),
    both_signs=True,
    steered=True,
    maker="jaxsat.spacecraft.magnetorquers:Magnetorquers.from_tables",
)


@rule("magnetorquer", "wheel", "gimbal", "thruster", "spacecraft.thruster_torque_axes")
def _something_is_left(magnetorquers, wheels, gimbals, thrusters, axes):
    others = wheels or gimbals or thrusters or axes
    if magnetorquers and not others and all(one.failed for one in magnetorquers):
        message = "must leave one that works where there are no wheels, gimbals and thrusters"
        yield at("magnetorquer", f"{message}, got {len(magnetorquers)} that have failed")


@rule("unloading.time_constant_s", "magnetorquer", "wheel")
def _unloading_has_both(time, magnetorquers, wheels):
    tables = {"[[wheel]]": wheels, "[[magnetorquer]]": magnetorquers}
    missing = " and ".join(name for name, given in tables.items() if not given)
    if missing:
        message = "must belong to wheels and magnetorquers that unload them"
        yield at("unloading", f"{message}, got time_constant_s = {shown(time)} without {missing}")
