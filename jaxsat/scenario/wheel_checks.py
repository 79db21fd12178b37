"""Rules on `[[wheel]]`."""

import numpy as np

from jaxsat.core.allocation import least_squares_map, what_is_left
from jaxsat.scenario.coordinates import free_inertia
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.layout import working_axes
from jaxsat.scenario.rules import at, rule, rule_over
from jaxsat.scenario.wheel_tables import left_by_wheels, rotors
from jaxsat.scenario.wording import shown

MISSING = 1e-9
"""A part of a command, relative to it, that counts as not made."""


@rule("wheel")
def _each_wheel_is_whole(wheels):
    names = [one.name or str(number) for number, one in enumerate(wheels, 1)]
    for number, one in enumerate(wheels):
        limit, momentum = one.momentum_limit_N_m_s, one.momentum_N_m_s
        if limit is not None and abs(momentum) > limit:
            message = f"must not exceed momentum_limit_N_m_s = {shown(limit)}"
            yield Issue(("wheel", number, "momentum_N_m_s"), f"{message}, got {shown(momentum)}")
        if one.viscous_friction_N_m_s and one.rotor_inertia_kg_m2 is None:
            message = "must be given in kg m² with viscous_friction_N_m_s, got nothing"
            yield Issue(("wheel", number, "rotor_inertia_kg_m2"), message, (), True)
        if names.index(names[number]) < number:
            message = f"must be a name of its own, got {shown(names[number])} again"
            yield Issue(("wheel", number, "name"), message)


@rule_over("wheel", "spacecraft.inertia_kg_m2")
def _rotors_are_part_of_the_body(values):
    wheels = values["wheel"]
    if not rotors(wheels).any():
        return
    for key in ("spacecraft.inertia_kg_m2", "control.model.inertia_kg_m2"):
        given = values.get(key)
        if given is None:
            continue
        if np.linalg.eigvalsh(free_inertia(given, wheels))[0] > 0:
            continue
        most = max(range(len(wheels)), key=lambda k: wheels[k].rotor_inertia_kg_m2 or 0.0)
        yield Issue(
            ("wheel", most, "rotor_inertia_kg_m2"),
            f"must be a part of {key}, which is that with the wheels locked: less the rotors of "
            "all wheels about their axes it must be positive definite, got "
            f"{shown(wheels[most].rotor_inertia_kg_m2)}",
        )


@rule("wheel", "control.law")
def _coulomb_friction_needs_a_sampled_law(wheels, law):
    if find_law(law).declaration.sampled:
        return
    for number, one in enumerate(wheels):
        if one.coulomb_friction_N_m:
            yield Issue(
                ("wheel", number, "coulomb_friction_N_m"),
                f'must be 0 under the law "{law}", whose torque changes all the time: a rotor '
                f"comes to rest and leaves it, got {shown(one.coulomb_friction_N_m)}",
            )


@rule("wheel", "spacecraft.third_rate")
def _wheels_leave_the_third_rate_free(wheels, third_rate):
    if wheels and third_rate == "held":
        yield at(
            "spacecraft.third_rate",
            'must be "free" with [[wheel]], whose momenta determine it, got "held"',
        )


@rule("wheel", "actuators")
def _wheels_go_with_jaxsats_own_actuators(wheels, actuators):
    if wheels and actuators is not None:
        yield at("actuators", "must not be given with [[wheel]]")


@rule(
    "control.law",
    "wheel",
    "thruster",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    "magnetorquer",
)
def _wheels_and_thrusters_make_what_the_law_commands(
    law, wheels, thrusters, axes, failed, magnetorquers
):
    declaration = find_law(law).declaration
    torques = declaration.torques
    if declaration.commands_wheels:
        yield from _wheels_alone(law, wheels, thrusters or axes)
        return
    if wheels and torques == 1:
        yield at("wheel", f'must be left out under the law "{law}", which knows thrusters alone')
    if not wheels or thrusters or magnetorquers or torques not in (2, 3):
        return
    working = working_axes(axes or (), failed)
    missing = what_is_left(working, least_squares_map(working, torques))
    missing = missing @ left_by_wheels(wheels, torques)
    if abs(missing).max() > MISSING:
        left = sum(not one.failed for one in wheels)
        which = "x and y" if torques == 2 else "x, y and z"
        yield at(
            "wheel",
            f"must leave wheels that make independent torques about body axes {which} with the "
            f"thrusters left, got {left} of {len(wheels)} wheels and {working.shape[1]} thrusters",
        )


def _wheels_alone(law, wheels, thrusters):
    """Issues under a law that diagnoses wheels: they alone make torques about three axes."""
    what = f'under the law "{law}", which diagnoses wheels'
    if thrusters:
        key = "spacecraft.thruster_torque_axes" if isinstance(thrusters[0], tuple) else "thruster"
        yield at(key, f"must not be given {what}, got {len(thrusters)}")
    if not wheels or left_by_wheels(wheels, 3).any():
        left = sum(not one.failed for one in wheels)
        message = f"must leave independent torques about body axes x, y and z {what}"
        yield at("wheel", f"{message}, got {left} of {len(wheels)}", not wheels)
    for number, one in enumerate(wheels):
        if one.torque_limit_N_m is None:
            message = f"must be given in N m {what} by their full torque, got nothing"
            yield Issue(("wheel", number, "torque_limit_N_m"), message, (), True)


@rule("wheel", "control.law")
def _tachometers_belong_to_a_sampled_law(wheels, law):
    for number, one in enumerate(wheels):
        if one.tachometer_noise_N_m_s and not find_law(law).declaration.sampled:
            message = f'must be 0 under the law "{law}", which is not sampled'
            found = shown(one.tachometer_noise_N_m_s)
            yield Issue(("wheel", number, "tachometer_noise_N_m_s"), f"{message}, got {found}")


@rule("wheel", "control.law", "simulation.solver.steps", "simulation.solver.step_s")
def _no_fixed_steps_across_a_momentum_limit(wheels, law, steps, step):
    if steps == "adaptive" or (steps is None and step is None) or find_law(law).declaration.sampled:
        return
    if any(one.momentum_limit_N_m_s is not None for one in wheels):
        yield at(
            f"simulation.solver.{'steps' if steps == 'fixed' else 'step_s'}",
            "must be left to adaptive steps where a wheel has a momentum limit, as its torque "
            f"ends there within a step, got {shown(steps if steps == 'fixed' else step)}",
        )
