"""Rules on `[[thruster]]` and `[modulation]`."""

import math

import numpy as np

from jaxsat.core.allocation import least_propellant, plane_map
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.rules import at, rule, rule_over
from jaxsat.scenario.thruster_tables import working_torques
from jaxsat.scenario.wheel_tables import wheels_make_all
from jaxsat.scenario.wording import shown

MAX_THRUSTERS = 24
"""Of which the table of bases stays small."""

NO_TORQUE = 1e-12
"""N m; a force through the centre of mass makes less by rounding."""


@rule(
    "thruster",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    "wheel",
    "magnetorquer",
)
def _one_kind_of_thruster(thrusters, axes, failed, wheels, magnetorquers):
    if not thrusters:
        if axes is None and not wheels and not magnetorquers:
            tables = "[[thruster]], [[wheel]] or [[magnetorquer]]"
            message = f"must be given, or tables {tables}, got none of them"
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
        given = {key for key in by_force + by_torque if getattr(one, key) is not None}
        if given in (set(by_force), set(by_torque)):
            if np.abs(one.torque()).max() <= NO_TORQUE:
                message = "must have a force that does not point through the centre of mass"
                yield Issue(("thruster", number, "direction"), f"{message}, got no torque")
            continue
        found = " and ".join(sorted(given)) or "none of them"
        yield Issue(
            ("thruster", number),
            f"must have {', '.join(by_force)}, or {' and '.join(by_torque)}, got {found}",
        )


@rule("thruster")
def _thrusters_have_names_of_their_own(thrusters):
    names = [one.name or str(number) for number, one in enumerate(thrusters, 1)]
    for number, name in enumerate(names):
        if names.index(name) < number:
            message = f"must be a name of its own, got {shown(name)} again"
            yield Issue(("thruster", number, "name"), message)


@rule("thruster", "control.law")
def _thrusters_need_a_sampled_law(thrusters, law):
    if thrusters and not find_law(law).declaration.sampled:
        allowed = [f'"{name}"' for name, one in LAWS.items() if one.declaration.sampled]
        yield at(
            "thruster",
            f'must belong to a sampled law ({", ".join(allowed)}), got "{law}", whose torque '
            "changes all the time (spacecraft.thruster_torque_axes has ideal torques)",
        )


@rule("thruster", "wheel", "control.law")
def _a_law_that_commands_duties_has_thrusters_alone(thrusters, wheels, law):
    if not find_law(law).declaration.commands_duties:
        return
    if not thrusters:
        message = f'must be given under the law "{law}", which diagnoses them, got none'
        yield at("thruster", message, True)
    if wheels:
        message = f'must not be given under the law "{law}", which knows of thrusters alone'
        yield at("wheel", f"{message}, got {len(wheels)}")


@rule("thruster", "actuators.kind")
def _one_kind_of_actuators(thrusters, kind):
    if thrusters:
        yield at("actuators", f"must not be given with [[thruster]], got {shown(kind)}")


def _whole(thrusters) -> bool:
    return all((one.force_N is None) != (one.torque_N_m is None) for one in thrusters) and all(
        None not in ((one.position_m, one.direction) if one.force_N else (one.torque_axis,))
        for one in thrusters
    )


@rule("thruster", "control.law", "wheel")
def _thrusters_make_what_the_law_commands(thrusters, law, wheels):
    declaration = find_law(law).declaration
    torques, any_plane = declaration.torques, declaration.any_plane and not wheels
    if wheels and torques and wheels_make_all(wheels, torques):
        return
    if not torques or not thrusters or not _whole(thrusters) or len(thrusters) > MAX_THRUSTERS:
        return
    torque = working_torques(thrusters)
    try:
        if not torque.size:
            raise ValueError("all have failed")
        command_map = plane_map(torque, torques, any_plane)
        least_propellant(torque, np.ones(torque.shape[1]), command_map)
    except ValueError as error:
        message = "must leave thrusters that the law can use, got those that cannot be used: "
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
            found = f"{message} = {delay:g}, got {one.valve_delay_s:g}"
            yield Issue(("thruster", number, "valve_delay_s"), found)


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
