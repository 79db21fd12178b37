"""Rules across several keys of a scenario.

Every rule names the keys that it reads and is applied if all of these are valid by themselves, so
that one mistake hides no other.
"""

import math

from jaxsat.core.allocation import allocation_matrix, torque_directions
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.scenario.derived import (
    ERROR_COORDINATE_KEYS,
    error_coordinate_obstacle,
    is_upside_down,
    torque_jumps,
    uses_error_coordinates,
)
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.torque_makers import TorqueMakers
from jaxsat.scenario.rules import STEPS, at, is_multiple, key_of_fixed_steps, rule, rule_over
from jaxsat.scenario.tables import ADAPTIVE_STEP_KEYS, FIXED_STEP_KEYS, working_axes
from jaxsat.scenario.wording import shown

MAX_SAMPLES = 2_000_000
"""Largest number of samples of one run; their signals take a third of a gigabyte."""


UNIT_LENGTH = 0.01
"""Tolerance on the length of a row of direction cosines, which are often given to few digits."""


@rule("spacecraft.thruster_torque_axes")
def _torque_axes_are_directions(axes):
    for number, row in enumerate([] if axes is None else axes):
        length = math.hypot(*row)
        if abs(length - 1) > UNIT_LENGTH:
            direction = shown([float(f"{one / length:.6g}") for one in row])
            yield Issue(
                ("spacecraft", "thruster_torque_axes", number),
                f"must have length 1, got length {length:.4g}: as a direction write {direction}; "
                f"a thruster of {length:.4g} times torque_limit_N_m is a [[thruster]] "
                "with two_sided = true, a torque_axis and a torque_N_m",
            )


@rule("spacecraft.thruster_torque_axes", "spacecraft.failed_thrusters")
def _failed_thrusters_exist(axes, failed):
    if axes is None:
        return
    for position, number in enumerate(failed):
        location = ("spacecraft", "failed_thrusters", position)
        if number > len(axes):
            yield Issue(location, f"must name thrusters from 1 to {len(axes)}, got {number}")
        elif failed.index(number) < position:
            yield Issue(location, f"must name each thruster once, got {number} again")


@rule_over(
    "control.law",
    "spacecraft.thruster_torque_axes",
    "spacecraft.failed_thrusters",
    *(one.name for one in ACTUATORS),
)
def _law_has_its_torques(values):
    declaration = values["control.law"].declaration
    axes = values["spacecraft.thruster_torque_axes"]
    failed, torques = values["spacecraft.failed_thrusters"], declaration.torques
    if axes is None or not torques or any(values[one.name] for one in ACTUATORS):
        return
    if declaration.commands_actuators:
        return  # which refuses them by a rule of its own
    if any(number > len(axes) for number in failed):
        return
    try:
        if declaration.any_plane:
            torque_directions(working_axes(axes, failed))
        else:
            allocation_matrix(working_axes(axes, failed), torques)
    except ValueError as error:
        key = "failed_thrusters" if failed else "thruster_torque_axes"
        yield at(
            f"spacecraft.{key}",
            f"must leave thrusters that the law can use, got {len(axes) - len(set(failed))} of "
            f"{len(axes)}: {str(error).rstrip('.')}",
        )


@rule("spacecraft.third_rate", "initial.omega_rad_s")
def _held_rate_starts_at_zero(third_rate, omega):
    if third_rate == "held" and omega[2] != 0:
        yield Issue(
            ("initial", "omega_rad_s", 2),
            'must have 0 rad/s as entry 3 while spacecraft.third_rate is "held", '
            f"got {shown(omega[2])}",
        )


ATTITUDE_KEYS = ("quaternion", "euler_rad", "euler_sequence", "mrp", "w", "z_rad")
PARTNERS = {
    "euler_rad": "euler_sequence",
    "euler_sequence": "euler_rad",
    "w": "z_rad",
    "z_rad": "w",
}
"""Keys of `[initial]` that define the attitude, and pairs of them that must be given together."""


@rule(*(f"initial.{key}" for key in ATTITUDE_KEYS))
def _one_attitude(*values):
    present = {key: one for key, one in zip(ATTITUDE_KEYS, values, strict=True) if one is not None}
    if not present:
        message = "must be given with z_rad, or quaternion, euler_rad or mrp, got none of them"
        yield at("initial.w", message, True)
        return
    first, *others = present
    partner = PARTNERS.get(first)
    if partner is not None and partner not in present:
        yield at(f"initial.{partner}", f"must be given with {first}, got nothing", True)
    for key in others:
        if key != partner:
            message = f"must not be given with {first}, got {shown(present[key])}"
            yield at(f"initial.{key}", message)


@rule("initial.w", "initial.omega_rad_s", "initial.z_rad")
def _state_below_its_limit(w, omega, z):
    for name, value in (("w", w), ("omega_rad_s", omega), ("z_rad", z)):
        size = max(map(abs, value if isinstance(value, tuple) else (value or 0,)), default=0)
        if size >= STATE_LIMIT:
            why = " (|w| without bound is upside down)" if name == "w" else ""
            yield at(f"initial.{name}", f"must be below {STATE_LIMIT:g}{why}, got {shown(value)}")


@rule("initial.quaternion", "simulation.attitude", "control.law")
def _not_upside_down(quaternion, attitude, law):
    if quaternion is None:
        return
    works_in_wz = law.declaration.works_in_wz
    if is_upside_down(quaternion) and (attitude == "wz" or works_in_wz):
        by = "simulation.attitude" if attitude == "wz" else "control.law"
        yield at(
            "initial.quaternion",
            "must not be upside down, where the (w, z) that "
            f"{by} = {shown(attitude if attitude == 'wz' else law.name)} works in are singular, "
            f"got {shown(quaternion)}",
        )


@rule("simulation.duration_s", "simulation.save_every_s")
def _whole_number_of_samples(duration, save_every):
    if duration / save_every > MAX_SAMPLES:
        yield at(
            "simulation.save_every_s",
            f"must leave at most {MAX_SAMPLES} saved samples, got {shown(save_every)} s in "
            f"{shown(duration)} s",
        )
    elif not is_multiple(duration, save_every):
        yield at(
            "simulation.duration_s",
            f"must be a multiple of save_every_s = {shown(save_every)}, got {shown(duration)}",
        )


@rule("control.period_s", "simulation.save_every_s", "simulation.duration_s")
def _samples_fall_on_periods(period, save_every, duration):
    if not is_multiple(save_every, period):
        yield at(
            "simulation.save_every_s",
            f"must be a multiple of control.period_s = {shown(period)}, got {shown(save_every)}",
        )
    elif is_multiple(duration, save_every) and not is_multiple(duration, period):
        yield at(
            "simulation.duration_s",
            f"must be a multiple of control.period_s = {shown(period)}, got {shown(duration)}",
        )


@rule("settled.dwell_s", "simulation.duration_s")
def _dwells_within_the_run(dwell, duration):
    if dwell is not None and dwell >= duration:
        yield at(
            "settled.dwell_s",
            f"must be below simulation.duration_s = {shown(duration)}, got {shown(dwell)}",
        )


@rule_over("simulation.coordinates", *ERROR_COORDINATE_KEYS)
def _error_coordinates_hold(values):
    obstacle = error_coordinate_obstacle(values)
    if values["simulation.coordinates"] == "error" and obstacle:
        yield at(
            "simulation.coordinates", f'must be "auto" or "torque" because {obstacle}, got "error"'
        )


@rule("control.law", "spacecraft.torque_limit_N_m", "thruster", "wheel")
def _gains_need_a_limit(law, limit, thrusters, wheels):
    declaration = law.declaration
    if not declaration.needs_torque_limit or limit is not None or thrusters:
        return
    if TorqueMakers(wheels, (), declaration).wheel_limit is not None:
        return
    message = f'must be given in N m under the law "{law}", whose gains depend on it, got nothing'
    for number, one in enumerate(wheels):
        if not one.failed:
            yield Issue(("wheel", number, "torque_limit_N_m"), message, (), True)
    if not wheels:
        yield at("spacecraft.torque_limit_N_m", message, True)


SOLVER_KEYS = ("steps", *ADAPTIVE_STEP_KEYS, *FIXED_STEP_KEYS, "substeps")


@rule_over("control.law")
def _solver_keys_fit(values):
    law = values["control.law"]
    solver = {key: values.get(f"simulation.solver.{key}") for key in SOLVER_KEYS}
    keys = [key for key in SOLVER_KEYS if solver[key] is not None]
    is_sampled = law.declaration.sampled
    fixed = solver["steps"] == "fixed" or (solver["steps"] is None and "step_s" in keys)
    if is_sampled:
        misfits = [key for key in keys if key != "substeps"]
        why = f'the law "{law}" is sampled and takes `substeps` equal steps in a period'
    elif "substeps" in keys:
        misfits, why = ["substeps"], f'the law "{law}" is continuous'
    elif fixed:
        misfits, why = [key for key in keys if key in ADAPTIVE_STEP_KEYS], "the steps are fixed"
    else:
        misfits, why = [key for key in keys if key in FIXED_STEP_KEYS], "the steps are adaptive"
    for key in misfits:
        message = f"must be left out because {why}, got {shown(solver[key])}"
        yield at(f"simulation.solver.{key}", message)
    if fixed and "step_s" not in keys and not is_sampled:
        message = "must be given in s with fixed steps, got nothing"
        yield at("simulation.solver.step_s", message, True)


@rule_over("simulation.solver.name", "control.law", *STEPS)
def _euler_has_no_error_estimate(values):
    adaptive = key_of_fixed_steps(values) is None and not values["control.law"].declaration.sampled
    if values["simulation.solver.name"] == "euler" and adaptive:
        yield at(
            "simulation.solver.name",
            'must be a solver with an error estimate while steps are adaptive, got "euler"',
        )


@rule_over("simulation.coordinates", *STEPS, *ERROR_COORDINATE_KEYS)
def _no_fixed_steps_across_jumps(values):
    key, law = key_of_fixed_steps(values), values["control.law"]
    if key and torque_jumps(values) and not uses_error_coordinates(values):
        yield at(
            key,
            f'must be left to adaptive steps: at torque level the law "{law}" holds the '
            "derivative of a saturation that jumps, and fixed steps of any size give errors as "
            f"large as the state; round it ({' and '.join(law.declaration.jumps_without)} above "
            f"0) or leave the torque unlimited, got {shown(values[key])}",
        )
