"""`[[thruster]]`, `[modulation]`: pushing thrusters, and the modulation of commands into pulses."""

import math
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Le

from jaxsat.core.allocation import least_propellant, plane_map, require_all_ways, unit_columns
from jaxsat.core.declaration.actuators import ACTUATORS, STEERED
from jaxsat.core.declaration.thrusters import THRUSTER
from jaxsat.core.ranges import SECONDS
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import table_of_device
from jaxsat.scenario.parts.torque_makers import TorqueMakers
from jaxsat.scenario.quantities import Number, ScenarioTable, choice, quantity, within
from jaxsat.scenario.rules import at, rule, rule_over, sampled_laws
from jaxsat.scenario.wording import shown

STANDARD_GRAVITY = 9.80665
"""Standard gravity, m/s²: specific impulse in s to exhaust velocity (CGPM, 1901)."""


MAX_THRUSTERS = 24
"""Largest number of thrusters for which the table of bases stays small."""

AXES = "spacecraft.thruster_torque_axes"

NO_ARM = 1e-12
"""Moment arm that is treated as zero, relative to the thruster's distance: round-off."""


class ThrusterTable(table_of_device(THRUSTER)):
    """`[[thruster]]`: one thruster, by its position and force or by its torque."""

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
        """Propellant flow at full thrust, kg/s; zero if it is not given."""
        if self.specific_impulse_s is None or self.force_N is None:
            return 0.0
        return self.force_N / (self.specific_impulse_s * STANDARD_GRAVITY)


ModulationKind = Literal["pwm", "delta-sigma", "pwpf", "ideal"]


class ModulationTable(ScenarioTable):
    """`[modulation]`: the modulation of commanded thrust into pulses."""

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
    """Kind of modulation; by default without a dead zone of the mean thrust, if possible."""
    if table is not None and table.kind is not None:
        return table.kind
    return "delta-sigma" if all(one.min_on_time_s > 0 for one in thrusters) else "pwm"


@rule_over(
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    *(one.name for one in ACTUATORS),
)
def _one_kind_of_thruster(values):
    axes = values["spacecraft.thruster_torque_axes"]
    failed = values["spacecraft.failed_thrusters"]
    if not values["thruster"]:
        if axes is None and not any(values[one.name] for one in ACTUATORS):
            *tables, last = (f"[[{one.name}]]" for one in ACTUATORS)
            message = f"must be given, or tables {', '.join(tables)} or {last}, got none of them"
            yield at("spacecraft.thruster_torque_axes", message, True)
        elif axes is None and failed:
            message = f"must not be given without thruster_torque_axes, got {shown(failed)}"
            yield at("spacecraft.failed_thrusters", message)
        return
    for name, value in (("thruster_torque_axes", axes), ("failed_thrusters", failed or None)):
        if value is not None:
            message = f"must not be given with [[thruster]], got {shown(value)}"
            yield at(f"spacecraft.{name}", message)


@rule("thruster")
def _each_thruster_is_whole(thrusters):
    if len(thrusters) > MAX_THRUSTERS:
        yield at("thruster", f"must be at most {MAX_THRUSTERS} tables, got {len(thrusters)}")
    by_force, by_torque = ("position_m", "direction", "force_N"), ("torque_axis", "torque_N_m")
    for number, one in enumerate(thrusters):
        if one.type is not None:
            continue  # an unknown type, which another rule reports
        keys = {key for key in by_force + by_torque if getattr(one, key) is not None}
        if keys in (set(by_force), set(by_torque)):
            if _has_no_arm(one):
                message = "must have a force that does not point through the centre of mass"
                yield Issue(("thruster", number, "direction"), f"{message}, got no torque")
            continue
        got = " and ".join(sorted(keys)) or "none of them"
        yield Issue(
            ("thruster", number),
            f"must have {', '.join(by_force)}, or {' and '.join(by_torque)}, got {got}",
        )


@rule("thruster", "control.law")
def _thrusters_need_a_sampled_law(thrusters, law):
    if thrusters and not law.declaration.sampled:
        yield at(
            "thruster",
            f'must belong to a sampled law ({sampled_laws()}), got "{law}", whose torque '
            "changes all the time (spacecraft.thruster_torque_axes has ideal torques)",
        )


@rule("thruster", "wheel", "magnetorquer", AXES, "control.law")
def _a_law_that_commands_actuators_has_some(thrusters, wheels, magnetorquers, axes, law):
    if not law.declaration.commands_actuators:
        return
    if axes is not None and not thrusters:
        message = f'must not be given under the law "{law}", which commands each actuator'
        yield at(AXES, f"{message} (it takes [[thruster]]), got {len(axes)}")
    elif not (thrusters or wheels or magnetorquers):
        message = f'must be given under the law "{law}", or [[wheel]], or [[magnetorquer]]'
        yield at("thruster", f"{message}, got none", True)


def _others_fly(makers: TorqueMakers, steered: bool) -> bool:
    """Whether other actuators may fly without torques of thrusters, so that rules of theirs decide.

    `steered`: whether actuators with a steering of their own work.
    """
    commands = makers.law.commands_actuators
    if makers.pushes.size:
        return (steered and commands) or makers.two_wheels_fly
    return steered or bool(makers.wheels and commands)


def _has_no_arm(thruster) -> bool:
    arm = NO_ARM * np.linalg.norm(thruster.position_m or 0.0)
    return bool(np.abs(thruster.torque()).max() <= arm * np.linalg.norm(thruster.force()))


def _whole(thrusters) -> bool:
    return all((one.force_N is None) != (one.torque_N_m is None) for one in thrusters) and all(
        None not in ((one.position_m, one.direction) if one.force_N else (one.torque_axis,))
        for one in thrusters
    )


@rule("thruster", "control.law", "wheel", *STEERED)
def _thrusters_make_what_the_law_commands(thrusters, law, wheels, *steered):
    makers = TorqueMakers(wheels, thrusters, law.declaration)
    torques, beside = law.declaration.torques, bool(makers.working_wheels)
    if beside and torques and makers.wheels_make_all:
        return
    if not torques or not thrusters or not _whole(thrusters) or len(thrusters) > MAX_THRUSTERS:
        return
    if any(_has_no_arm(one) for one in thrusters):
        return  # another rule reports it
    makers = TorqueMakers.among(wheels, thrusters, np.zeros((3, 0)), law.declaration)
    torque, beside = makers.pushes, bool(makers.working_wheels)
    if _others_fly(makers, any(not one.failed for tables in steered for one in tables)):
        return
    together = beside and makers.together and not makers.plane_flies
    try:
        if not torque.size:
            raise ValueError("all have failed")
        if together:
            axes = makers.axes
            require_all_ways(np.concatenate([unit_columns(torque), axes, -axes], axis=1))
        else:
            command_map = plane_map(torque, *makers.torques_of_thrusters)
            least_propellant(torque, np.ones(torque.shape[1]), command_map)
    except ValueError as error:
        message = (
            f"must leave thrusters that the law can use{' with the wheels' if together else ''}, "
            "got those that cannot be used: "
        )
        yield at("thruster", message + str(error).rstrip("."))


@rule_over("thruster", "control.period_s")
def _thrust_follows_within_a_period(values):
    thrusters, period = values["thruster"], values["control.period_s"]
    delay = values.get("sampling.delay_s", 0.0)
    for number, one in enumerate(thrusters):
        for key in ("min_on_time_s", "rise_time_s", "fall_time_s"):
            if getattr(one, key) > period:
                message = f"must be at most control.period_s = {shown(period)}"
                yield Issue(("thruster", number, key), f"{message}, got {getattr(one, key)}")
        if one.valve_delay_s + delay > period:
            message = f"must be at most control.period_s = {shown(period)} with sampling.delay_s"
            problem = f"{message} = {delay:g}, got {one.valve_delay_s:g}"
            yield Issue(("thruster", number, "valve_delay_s"), problem)


@rule("thruster", "modulation.kind")
def _modulation_suits_the_valves(thrusters, kind):
    if not thrusters:
        got = "a table" if kind is None else shown(kind)
        yield at("modulation", f"must belong to tables [[thruster]], got {got} and none")
    for number, one in enumerate(thrusters):
        if kind == "delta-sigma" and one.min_on_time_s == 0:
            message = "must be above 0, as delta-sigma modulation gives out multiples of it, got 0"
            yield Issue(("thruster", number, "min_on_time_s"), message)


@rule(
    "thruster",
    "modulation.kind",
    "modulation.gain",
    "modulation.time_constant_s",
    "modulation.on_level",
    "modulation.off_level",
)
def _schmitt_trigger_switches(thrusters, kind, gain, lag, high, low):
    if kind != "pwpf":
        return
    if not low < high < gain:
        message = f"must be above on_level = {high:g}, and that above off_level = {low:g}"
        yield at("modulation.gain", f"{message}, got {gain:g}")
        return
    shortest = lag * math.log((gain + high) / (gain + low))
    for number, one in enumerate(thrusters):
        if one.min_on_time_s > shortest:
            message = f"must be at most the shortest pulse of the PWPF, {shortest:.4g} s"
            hint = "a longer modulation.time_constant_s makes it longer"
            yield Issue(
                ("thruster", number, "min_on_time_s"),
                f"{message} ({hint}), got {one.min_on_time_s:g}",
            )
