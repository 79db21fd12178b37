"""Rules on `[[failure]]`."""

from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.rules import rule, rule_over
from jaxsat.scenario.thruster_tables import (
    IDEAL_FAILURES,
    MAGNETORQUER_FAILURES,
    THRUSTER_FAILURES,
    WHEEL_FAILURES,
    names_of,
    number_of,
)
from jaxsat.scenario.wording import shown

KINDS = (THRUSTER_FAILURES, IDEAL_FAILURES, WHEEL_FAILURES)

AMOUNTS = sorted({key for kinds in KINDS for keys in kinds.values() for key in keys})
"""Keys that say how much."""


@rule("failure", "thruster", "spacecraft.thruster_torque_axes", "wheel", "magnetorquer")
def _failures_have_something_to_strike(failures, thrusters, axes, wheels, magnetorquers):
    parts = {"thruster": thrusters or axes or (), "wheel": wheels, "magnetorquer": magnetorquers}
    for number, one in enumerate(failures):
        if number_of(one.of, one.part, parts.get(one.part, ())) is None:
            names = [f'"{part} {name}"' for part, all in parts.items() for name in names_of(all)]
            few = f"one of {', '.join(names[:6])}" if names else "an actuator"
            yield Issue(("failure", number, "of"), f"must name {few}, got {shown(one.of)}")


@rule("failure")
def _one_actuator_fails_once_at_a_time(failures):
    for number, one in enumerate(failures):
        for before, other in enumerate(failures[:number], 1):
            if (one.of, one.at_s) == (other.of, other.at_s):
                yield Issue(
                    ("failure", number, "at_s"),
                    f"must differ from that of failure {before}: of two failures of {one.of} the "
                    f"later one replaces the earlier, and at one instant neither is (here "
                    f'"{other.kind}" and "{one.kind}"), got {shown(one.at_s)}',
                )


@rule("failure", "thruster")
def _failures_say_what_and_how_much(failures, thrusters):
    ideal = not thrusters
    parts = {
        "thruster": IDEAL_FAILURES if ideal else THRUSTER_FAILURES,
        "wheel": WHEEL_FAILURES,
        "magnetorquer": MAGNETORQUER_FAILURES,
    }
    for number, one in enumerate(failures):
        kinds = parts.get(one.part)
        if kinds is None:
            continue
        if one.kind not in kinds:
            which = "thruster of thruster_torque_axes" if kinds is IDEAL_FAILURES else one.part
            message = f"must be one of {', '.join(kinds)} for a {which}, got {shown(one.kind)}"
            yield Issue(("failure", number, "kind"), message)
            continue
        yield from _amounts(number, one, kinds[one.kind])
        both_signs = kinds in (IDEAL_FAILURES, MAGNETORQUER_FAILURES)
        signed = both_signs and one.kind == "stuck-at"
        if one.fraction is not None and one.fraction < 0 and not signed:
            message = f"must be at least 0, got {shown(one.fraction)}"
            yield Issue(("failure", number, "fraction"), message)


def _amounts(number, one, wanted):
    """Issues on the keys that say how much."""
    given = [key for key in AMOUNTS if getattr(one, key) is not None]
    what = f'for a failure of kind "{one.kind}"'
    for key in given:
        if key not in wanted:
            found = shown(getattr(one, key))
            yield Issue(("failure", number, key), f"must not be given {what}, got {found}")
    if wanted and not set(given) & set(wanted):
        message = f"must be given {what}, got nothing"
        yield Issue(("failure", number, wanted[-1]), message, (), True)
    elif len(set(given) & set(wanted)) > 1:
        message = f"must not be given with {wanted[0]} {what}"
        yield Issue(("failure", number, wanted[-1]), message)


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


@rule("failure", "spacecraft.torque_limit_N_m", "thruster")
def _stuck_torques_have_a_size(failures, limit, thrusters):
    for number, one in enumerate(failures):
        ideal = not thrusters and one.part == "thruster"
        if ideal and limit is None and one.kind.startswith("stuck"):
            message = f'must not be "{one.kind}" without spacecraft.torque_limit_N_m'
            yield Issue(
                ("failure", number, "kind"), f"{message}: the stuck torque is a fraction of it"
            )


@rule("failure", "control.law")
def _failures_suit_the_law(failures, law):
    sampled = find_law(law).declaration.sampled
    for number, one in enumerate(failures):
        if one.friction_N_m is not None and not sampled:
            yield Issue(
                ("failure", number, "friction_N_m"),
                f'must be left out under the law "{law}", whose torque changes all the time: '
                f"Coulomb friction needs a sampled law, got {shown(one.friction_N_m)}",
            )


@rule_over("failure", "control.law")
def _what_has_seized_stays_so_under_a_continuous_law(values):
    """Where it may be freed by a later failure of the same wheel, or by one that is drawn so."""
    law, failures = values["control.law"], values["failure"]
    if find_law(law).declaration.sampled:
        return
    drawn = {
        name: any(key.startswith(f"dispersion.{name}.") for key in values)
        for name in ("failure_time_s", "failure_kind", "failed_wheel")
    }
    wheels = [(number, one) for number, one in enumerate(failures) if one.part == "wheel"]
    for number, one in wheels:
        frees = any(
            (other.of == one.of or drawn["failed_wheel"])
            and (other.kind == "stopped" or drawn["failure_kind"])
            and (other.at_s < one.at_s or drawn["failure_time_s"])
            for place, other in wheels
            if place != number
        )
        if frees:
            yield Issue(
                ("failure", number, "of"),
                f'must not be a wheel that may have "stopped" before, under the law "{law}": only '
                f"a sampled law lets one that has seized turn again, got {shown(one.of)}",
            )


@rule("failure", "actuators.kind")
def _failures_are_those_of_jaxsats_own_actuators(failures, kind):
    if failures:
        yield Issue(("failure",), f"must not be given with actuators.kind = {shown(kind)}")


@rule("failure", "control.law", "simulation.solver.steps", "simulation.solver.step_s")
def _no_fixed_steps_across_a_failure(failures, law, steps, step):
    fixed = steps == "fixed" or (steps is None and step is not None)
    if failures and fixed and not find_law(law).declaration.sampled:
        yield Issue(
            ("simulation", "solver", "steps" if steps == "fixed" else "step_s"),
            "must be left to adaptive steps where something fails in flight, which ends a step, "
            f"got {shown(steps if steps == 'fixed' else step)}",
        )
