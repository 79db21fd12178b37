"""`[[wheel]]` and `[unloading]`: rules of reaction wheels, and quantities from their keys."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Le
from jaxtyping import Float

from jaxsat.core.allocation import least_squares_map, unmade_map
from jaxsat.core.declaration.actuators import ACTUATORS, STEERED
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.declaration.wheels import WHEEL
from jaxsat.core.ranges import SECONDS, Range
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import number_of, table_of_device
from jaxsat.scenario.parts.torque_makers import (
    MISSING,
    Tables,
    TorqueMakers,
    left_by_wheels,
    wheel_axes,
)
from jaxsat.scenario.quantities import (
    STAND_IN,
    Number,
    ScenarioTable,
    inertia_matrix,
    quantity,
    within,
)
from jaxsat.scenario.rules import STEPS, at, key_of_fixed_steps, outage_mistakes, rule, rule_over
from jaxsat.scenario.tables import working_axes
from jaxsat.scenario.wording import shown

WHEEL_SPEED = Range(-1e6, 1e6)
"""Range of rotor speeds, rad/s."""


class WheelTable(table_of_device(WHEEL)):
    """`[[wheel]]`: one reaction wheel."""

    speed_rad_s: Annotated[Number, within(WHEEL_SPEED)] | None = quantity(
        "Speed of its rotor relative to the body at the start, in place of momentum_N_m_s, with "
        "rotor_inertia_kg_m2",
        "rad/s",
        **STAND_IN,
    )
    speed_limit_rad_s: Annotated[Number, Gt(0), Le(WHEEL_SPEED.high)] | None = quantity(
        "Largest speed of its rotor, in place of momentum_limit_N_m_s, with rotor_inertia_kg_m2",
        "rad/s",
        **STAND_IN,
    )


SPEEDS = {"speed_rad_s": "momentum_N_m_s", "speed_limit_rad_s": "momentum_limit_N_m_s"}
"""Momentum key that replaces each speed key; the factor is the rotor inertia."""


def rotors(wheels: Tables) -> np.ndarray:
    """Σ J_w a aᵀ (3, 3) of all wheels, kg m²."""
    axes = wheel_axes(wheels)
    inertia = np.array([one.rotor_inertia_kg_m2 or 0.0 for one in wheels])
    return (inertia * axes) @ axes.T


def free_inertia(inertia: tuple, wheels: Tables) -> np.ndarray:
    """Inertia without the rotors' spin axes, kg m²; `inertia` is with the wheels locked."""
    return inertia_matrix(inertia) - rotors(wheels)


def inertia_of(scenario: Any) -> np.ndarray:
    """Inertia of a checked scenario without the rotors' spin axes, kg m²."""
    return free_inertia(scenario.spacecraft.inertia_kg_m2, scenario.wheel)


@rule("wheel")
def _each_wheel_is_whole(wheels):
    for number, one in enumerate(wheels):
        limit, momentum = one.momentum_limit_N_m_s, one.momentum_N_m_s
        if limit is not None and abs(momentum) > limit:
            message = f"must not exceed momentum_limit_N_m_s = {shown(limit)}"
            yield Issue(("wheel", number, "momentum_N_m_s"), f"{message}, got {shown(momentum)}")
        speeds = [key for key in SPEEDS if getattr(one, key) is not None]
        needing = [*speeds, *(["viscous_friction_N_m_s"] if one.viscous_friction_N_m_s else ())]
        if needing and one.rotor_inertia_kg_m2 is None:
            message = f"must be given in kg m² with {needing[0]}, got nothing"
            yield Issue(("wheel", number, "rotor_inertia_kg_m2"), message, (), True)
        for key in speeds if one.rotor_inertia_kg_m2 is not None else ():
            message = f"must not be given with {SPEEDS[key]}, got {shown(getattr(one, key))}"
            yield Issue(("wheel", number, key), message)


@rule_over("wheel", "spacecraft.inertia_kg_m2")
def _rotors_are_part_of_the_body(values):
    wheels = values["wheel"]
    if not rotors(wheels).any():
        return
    for key in ("spacecraft.inertia_kg_m2", "control.model.inertia_kg_m2"):
        inertia = values.get(key)
        if inertia is None:
            continue
        if np.linalg.eigvalsh(free_inertia(inertia, wheels))[0] > 0:
            continue
        most = max(range(len(wheels)), key=lambda k: wheels[k].rotor_inertia_kg_m2 or 0.0)
        yield Issue(
            ("wheel", most, "rotor_inertia_kg_m2"),
            f"must be a part of {key}, which is that with the wheels locked: less the rotors of "
            "all wheels about their axes it must be positive definite, got "
            f"{shown(wheels[most].rotor_inertia_kg_m2)}",
        )


@rule("wheel", "control.law")
def _settling_laws_suit_the_momentum_of_wheels(wheels, law):
    working, declaration = sum(not one.failed for one in wheels), law.declaration
    if working and declaration.needs_gyroscopic_torque:
        yield at(
            "wheel",
            f'must leave none under the law "{law}", which moves the third axis by the gyroscopic '
            "torque of the body: the momentum of wheels changes it, and of two wheels alone "
            f'cancels it ("three-slew" and "three-axis" turn the body without it), got {working}',
        )


@rule("wheel", "control.law")
def _coulomb_friction_needs_a_sampled_law(wheels, law):
    if law.declaration.sampled:
        return
    for number, one in enumerate(wheels):
        if one.coulomb_friction_N_m:
            yield Issue(
                ("wheel", number, "coulomb_friction_N_m"),
                f'must be 0 under the law "{law}", whose torque changes all the time: a rotor '
                f"comes to rest and leaves it, got {shown(one.coulomb_friction_N_m)}",
            )


@rule_over(
    "control.law",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    *(one.name for one in ACTUATORS),
)
def _wheels_and_thrusters_make_what_the_law_commands(values):
    law, wheels, thrusters = (values[key] for key in ("control.law", "wheel", "thruster"))
    axes = values["spacecraft.thruster_torque_axes"]
    declaration = law.declaration
    torques = declaration.torques
    if declaration.commands_actuators:
        others = (*thrusters, *values["magnetorquer"])
        yield from _diagnosis_issues(law, wheels, any(not one.failed for one in others))
        return
    if wheels and torques == 1:
        yield at("wheel", f'must be left out under the law "{law}", which knows thrusters alone')
    has_steering = any(values[name] for name in STEERED)
    if not wheels or thrusters or has_steering or torques not in (2, 3):
        return
    working = working_axes(axes or (), values["spacecraft.failed_thrusters"])
    if lacks_torque(wheels, working, declaration):
        count = sum(not one.failed for one in wheels)
        which = "x and y" if torques == 2 else "x, y and z"
        yield at(
            "wheel",
            f"must leave wheels that make independent torques about body axes {which} with the "
            f"thrusters left, got {count} of {len(wheels)} wheels and {working.shape[1]} thrusters",
        )


def lacks_torque(
    wheels: Tables, ideal: Float[np.ndarray, "3 m"], declaration: LawDeclaration
) -> bool:
    """Whether wheels, and then ideal thrusters along unit axes, do not make what a law commands.

    Ideal thrusters make the torque that wheels leave by fixed shares: wheels do not take out what
    these make beside it.
    """
    missing = unmade_map(ideal, least_squares_map(ideal, declaration.torques))
    missing = missing @ TorqueMakers(wheels, (), declaration).remainder
    return bool(abs(missing).max() > MISSING)


def _diagnosis_issues(law, wheels, beside):
    """Yield issues under a law that commands each wheel; `beside`: whether other actuators work."""
    what = f'under the law "{law}", which diagnoses wheels'
    if wheels and not beside and np.trace(left_by_wheels(wheels, 3)) > 1 + MISSING:
        count = sum(not one.failed for one in wheels)
        message = (
            "must leave torques about two axes at least where neither thrusters nor magnetorquers "
            f"make others, {what}"
        )
        yield at("wheel", f"{message}, got {count} of {len(wheels)}")
    for number, one in enumerate(wheels):
        if one.torque_limit_N_m is None:
            message = f"must be given in N m {what} by their full torque, got nothing"
            yield Issue(("wheel", number, "torque_limit_N_m"), message, (), True)


@rule("wheel", "control.law")
def _tachometers_belong_to_a_sampled_law(wheels, law):
    for number, one in enumerate(wheels):
        if one.tachometer_noise_N_m_s and not law.declaration.sampled:
            message = f'must be 0 under the law "{law}", which is not sampled'
            got = shown(one.tachometer_noise_N_m_s)
            yield Issue(("wheel", number, "tachometer_noise_N_m_s"), f"{message}, got {got}")
        if one.tachometer_outage_start_s is not None and not law.declaration.sampled:
            message = f'must be left out under the law "{law}", which is not sampled'
            got = shown(one.tachometer_outage_start_s)
            yield Issue(("wheel", number, "tachometer_outage_start_s"), f"{message}, got {got}")


@rule("wheel")
def _outages_of_tachometers_are_complete(wheels):
    prefix = "tachometer_"
    for number, one in enumerate(wheels):
        names = (f"{prefix}outage{end}_s" for end in ("_start", "", "_every"))
        values = {name: getattr(one, name) for name in names}
        for name, message, absent in outage_mistakes(values, prefix):
            yield Issue(("wheel", number, name), message, (), absent)


@rule_over("wheel", "control.law", *STEPS)
def _no_fixed_steps_across_a_momentum_limit(values):
    key = key_of_fixed_steps(values)
    if key and any(one.momentum_limit_N_m_s is not None for one in values["wheel"]):
        yield at(
            key,
            "must be left to adaptive steps where a wheel has a momentum limit, as its torque "
            f"ends there within a step, got {shown(values[key])}",
        )


@rule("failure", "wheel")
def _wheels_can_fail_so(failures, wheels):
    for number, one in enumerate(failures):
        place = number_of(one.of, "wheel", wheels)
        if place is None:
            continue
        wheel = wheels[place]
        if one.kind == "runaway" and wheel.torque_limit_N_m is None:
            message = f'must be given for a failure of {one.of} by "runaway", got nothing'
            yield Issue(("wheel", place, "torque_limit_N_m"), message, (), True)
        if one.factor is not None and not (
            wheel.viscous_friction_N_m_s or wheel.coulomb_friction_N_m
        ):
            message = f"must be left out where {one.of} has no friction, got {shown(one.factor)}"
            yield Issue(("failure", number, "factor"), f"{message} (friction_N_m gives it some)")


@rule("failure", "control.law")
def _failures_suit_the_law(failures, law):
    sampled = law.declaration.sampled
    for number, one in enumerate(failures):
        if one.friction_N_m is not None and not sampled:
            yield Issue(
                ("failure", number, "friction_N_m"),
                f'must be left out under the law "{law}", whose torque changes all the time: '
                f"Coulomb friction needs a sampled law, got {shown(one.friction_N_m)}",
            )


@rule_over("failure", "control.law")
def _what_has_seized_stays_so_under_a_continuous_law(values):
    """Yield issues if a later or drawn failure of the same wheel may free a seized rotor."""
    law, failures = values["control.law"], values["failure"]
    if law.declaration.sampled:
        return
    draws = {
        name: any(key.startswith(f"dispersion.{name}.") for key in values)
        for name in ("failure_time_s", "failure_kind", "failed_wheel")
    }
    wheels = [(number, one) for number, one in enumerate(failures) if one.part == "wheel"]
    for number, one in wheels:
        frees = any(
            (other.of == one.of or draws["failed_wheel"])
            and (other.kind == "stopped" or draws["failure_kind"])
            and (other.at_s < one.at_s or draws["failure_time_s"])
            for place, other in wheels
            if place != number
        )
        if frees:
            yield Issue(
                ("failure", number, "of"),
                f'must not be a wheel that may have "stopped" before, under the law "{law}": only '
                f"a sampled law lets one that has seized turn again, got {shown(one.of)}",
            )


class UnloadingTable(ScenarioTable):
    """`[unloading]`: unloading of wheels by magnetorquers, or regulation of a momentum bias."""

    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time in which the wheels' momentum across the Earth's field is to fall to 1/e", "s", 1000.0
    )
    bias_N_m_s: Number = quantity(
        "Momentum of the wheels about negative body y, in the orbit frame the orbit normal, that "
        "magnetorquers keep",
        "N m s",
        0.0,
    )


@rule("unloading.bias_N_m_s", "wheel")
def _wheels_hold_the_bias(bias, wheels):
    if not bias or not wheels:
        return
    missing = left_by_wheels(wheels, 3) @ [0.0, bias, 0.0]
    if np.abs(missing).max() > MISSING * abs(bias):
        message = "must be 0 where the wheels left make no torque about body y alone"
        yield at("unloading.bias_N_m_s", f"{message}, got {shown(bias)}")


@rule("unloading.time_constant_s", "magnetorquer", "wheel")
def _unloading_has_both(time, magnetorquers, wheels):
    tables = {"[[wheel]]": wheels, "[[magnetorquer]]": magnetorquers}
    missing = " and ".join(name for name, rows in tables.items() if not rows)
    if missing:
        message = "must belong to wheels and magnetorquers that unload them"
        yield at("unloading", f"{message}, got time_constant_s = {shown(time)} without {missing}")
