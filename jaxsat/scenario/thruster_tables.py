"""`[[thruster]]`, `[modulation]`, `[[failure]]`: thrusters that push, and what breaks in flight."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len
from pydantic import AfterValidator

from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import FRICTION, ROTATION, SECONDS, TORQUE_LIMIT, Range
from jaxsat.scenario.quantities import (
    Line,
    Number,
    Switch,
    Table,
    Vector3,
    choice,
    quantity,
    within,
)

FORCE = Range(1e-9, 1e9)
"""Of a thruster, N."""

POSITION = Range(-1e3, 1e3)
"""Of a thruster, m."""

SPECIFIC_IMPULSE = Range(1.0, 1e5)
"""s; cold gas has 60, an ion engine some thousands."""

STANDARD_GRAVITY = 9.80665
"""m/s², which turns a specific impulse in s into an exhaust velocity (CGPM, 1901)."""


def _direction(value: tuple) -> tuple:
    if not 1e-12 <= sum(entry * entry for entry in value) <= 1e12:
        raise ArgumentError("value", "must be a direction", value)
    return value


Direction = Annotated[Vector3, AfterValidator(_direction)]
Position3 = Annotated[tuple[Annotated[Number, within(POSITION)], ...], Len(3, 3)]
Rotation3 = Annotated[tuple[Annotated[Number, within(ROTATION)], ...], Len(3, 3)]
Time = Annotated[Number, Ge(0), Le(SECONDS.high)]


class ThrusterTable(Table):
    """`[[thruster]]`: one thruster, by its place and force or by its torque."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    position_m: Position3 | None = quantity(
        "Where it sits, from the centre of mass, body axes", "m", None
    )
    direction: Direction | None = quantity(
        "Direction of its force on the body, body axes", "1", None
    )
    force_N: Annotated[Number, within(FORCE)] | None = quantity("Full thrust", "N", None)
    torque_axis: Direction | None = quantity(
        "Direction of its torque, body axes, in place of position and direction", "1", None
    )
    torque_N_m: Annotated[Number, within(TORQUE_LIMIT)] | None = quantity(
        "Torque at full thrust, in place of the force", "N m", None
    )
    two_sided: Switch = choice(
        "Whether it is a pair that also pushes the other way, else it pushes one way only", False
    )
    min_on_time_s: Time = quantity("Shortest time that its valve is open", "s", 0.0)
    valve_delay_s: Time = quantity("Time from a command to the valve", "s", 0.0)
    rise_time_s: Time = quantity("Time from no thrust to full thrust, on a straight line", "s", 0.0)
    fall_time_s: Time = quantity("Time from full thrust to none, on a straight line", "s", 0.0)
    specific_impulse_s: Annotated[Number, within(SPECIFIC_IMPULSE)] | None = quantity(
        "Specific impulse; by default its propellant is not counted", "s", None
    )
    failed: Switch = choice("Whether it has failed before the start, and the law knows it", False)

    def torque(self) -> np.ndarray:
        """Torque on the body at full thrust, N m."""
        if self.torque_axis is not None and self.torque_N_m is not None:
            axis = np.array(self.torque_axis)
            return axis / np.linalg.norm(axis) * self.torque_N_m
        return np.cross(np.array(self.position_m), self.force())

    def force(self) -> np.ndarray:
        """Force on the body at full thrust, N; zero for a thruster given by its torque."""
        if self.direction is None or self.force_N is None:
            return np.zeros(3)
        direction = np.array(self.direction)
        return direction / np.linalg.norm(direction) * self.force_N

    def propellant_flow(self) -> float:
        """Propellant at full thrust, kg/s; none where it is not told."""
        if self.specific_impulse_s is None or self.force_N is None:
            return 0.0
        return self.force_N / (self.specific_impulse_s * STANDARD_GRAVITY)


ModulationKind = Literal["pwm", "delta-sigma", "pwpf", "ideal"]


class ModulationTable(Table):
    """`[modulation]`: how commanded thrust becomes pulses."""

    kind: ModulationKind | None = choice(
        'Pulse width ("pwm"), whole minimum pulses whose remainder is kept ("delta-sigma"), pulse '
        'width and frequency by a Schmitt trigger behind a lag ("pwpf"), or a throttle ("ideal"); '
        'by default "delta-sigma" where every thruster has a min_on_time_s, else "pwm"',
        None,
    )
    gain: Annotated[Number, Gt(0), Le(1e6)] = quantity("Gain of the lag of PWPF", "1", 4.5)
    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time constant of the lag of PWPF", "s", 0.15
    )
    on_level: Annotated[Number, Gt(0), Le(1e6)] = quantity(
        "Output of the lag at which PWPF opens", "1", 0.45
    )
    off_level: Annotated[Number, Gt(0), Le(1e6)] = quantity(
        "Output of the lag at which PWPF shuts", "1", 0.15
    )


def modulation_kind(
    table: ModulationTable | None, thrusters: tuple[ThrusterTable, ...]
) -> ModulationKind:
    """How thrusters are pulsed; by default the mean thrust has no dead zone, if possible."""
    if table is not None and table.kind is not None:
        return table.kind
    return "delta-sigma" if all(one.min_on_time_s > 0 for one in thrusters) else "pwm"


THRUSTER_FAILURES = {
    "dead": (),
    "degraded": ("fraction",),
    "stuck-on": (),
    "stuck-at": ("fraction",),
    "leaking": ("fraction",),
    "delayed": ("delay_s",),
    "intermittent": ("fraction",),
    "turned": ("turn_rad",),
}
"""The keys of which one says how much, by kind: those of `jaxsat.spacecraft.FailureKind`."""

IDEAL_FAILURES = {
    "dead": (),
    "degraded": ("fraction",),
    "stuck-on": (),
    "stuck-at": ("fraction",),
    "turned": ("turn_rad",),
    "reversed": (),
}
"""The same of thrusters of `spacecraft.thruster_torque_axes`, whose torques have both signs."""

MAGNETORQUER_FAILURES = {kind: keys for kind, keys in IDEAL_FAILURES.items() if kind != "turned"}
"""The same of magnetorquers, whose dipoles have both signs."""

WHEEL_FAILURES = {
    "dead": (),
    "degraded": ("fraction",),
    "stopped": (),
    "friction-up": ("factor", "friction_N_m"),
    "runaway": (),
}
"""The same of wheels: `jaxsat.spacecraft.WheelFailureKind`, of which two are friction-up."""

FailureName = Literal[
    "dead",
    "degraded",
    "stuck-on",
    "stuck-at",
    "leaking",
    "delayed",
    "intermittent",
    "turned",
    "stopped",
    "friction-up",
    "runaway",
    "reversed",
]


class FailureTable(Table):
    """`[[failure]]`: what happens to an actuator in flight; the law is not told.

    Of several failures of one actuator the later one replaces the earlier.
    """

    of: Line = choice(
        'What fails, such as "thruster 3", "wheel 2", "magnetorquer 1" or "thruster" and its name'
    )
    at_s: Time = quantity("When it fails", "s")
    kind: FailureName = choice(
        'Of any: "dead" (no torque), "degraded" (fraction of it left). Of a thruster: "stuck-on", '
        '"stuck-at" (a fraction of full thrust), "leaking" (never less than a fraction), "delayed" '
        '(delay_s), "intermittent" (off for a fraction of every 10 s), "turned" (turn_rad). Of a '
        'wheel: "stopped" (at once, its momentum goes to the body), "friction-up" (factor or '
        'friction_N_m), "runaway" (full torque, the way that it turns). Of a thruster of '
        'thruster_torque_axes: "stuck-on", "stuck-at", "turned", "reversed". Of a magnetorquer: '
        '"stuck-on" (its dipole limit), "stuck-at" (a fraction of it), "reversed"'
    )
    fraction: Annotated[Number, Ge(-1), Le(1)] | None = quantity(
        "How much, of full thrust or torque or of time; below 0 only of a torque of either sign "
        "that is stuck",
        "1",
        None,
    )
    delay_s: Time | None = quantity("How much later its valve follows", "s", None)
    turn_rad: Rotation3 | None = quantity(
        "Rotation vector by which its force, or its torque where only that is given, is turned, "
        "body axes",
        "rad",
        None,
    )
    factor: Annotated[Number, within(FRICTION)] | None = quantity(
        "Factor on its viscous and Coulomb friction", "1", None
    )
    friction_N_m: Annotated[Number, within(FRICTION)] | None = quantity(
        "Coulomb friction that it now has, if it had less", "N m", None
    )

    @property
    def part(self) -> str:
        """What kind of part fails: the first word of `of`."""
        return self.of.partition(" ")[0]


def number_of(of: str, part: str, tables: Sequence[Any]) -> int | None:
    """Which of the tables, from 0, "PART 3" or "PART NAME" is; None if there is none.

    Of what has no name, such as torque axes, the number is told.
    """
    kind, _, which = of.partition(" ")
    names = names_of(tables)
    return names.index(which) if kind == part and which in names else None


def names_of(tables: Sequence[Any]) -> list[str]:
    """The name of each table, or its number from 1."""
    return [getattr(one, "name", None) or str(number) for number, one in enumerate(tables, 1)]


def working_torques(thrusters: tuple[ThrusterTable, ...]) -> np.ndarray:
    """Torques (3, m) at full thrust of what works at the start, both ways of two-sided ones."""
    columns = [sign * one.torque() for one in thrusters if not one.failed for sign in signs(one)]
    return np.array(columns).reshape(-1, 3).T


def signs(thruster: ThrusterTable) -> tuple[float, ...]:
    """Which way it pushes: 1 and, where it is two-sided, -1."""
    return (1.0, -1.0) if thruster.two_sided else (1.0,)
