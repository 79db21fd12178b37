"""Rules on `[[failure]]`."""

from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.rules import rule
from jaxsat.scenario.thruster_tables import FAILURES, number_of
from jaxsat.scenario.wording import shown

AMOUNTS = sorted({key for kinds in FAILURES.values() for keys in kinds.values() for key in keys})
"""Keys that say how much."""


@rule("failure", "thruster", "wheel")
def _failures_have_something_to_strike(failures, thrusters, wheels):
    parts = {"thruster": thrusters, "wheel": wheels}
    for number, one in enumerate(failures):
        if number_of(one.of, one.part, parts.get(one.part, ())) is None:
            names = [
                f'"{part} {table.name or n}"'
                for part, tables in parts.items()
                for n, table in enumerate(tables, 1)
            ]
            few = f"one of {', '.join(names[:6])}" if names else "a table [[thruster]] or [[wheel]]"
            yield Issue(("failure", number, "of"), f"must name {few}, got {shown(one.of)}")


@rule("failure")
def _failures_say_what_and_how_much(failures):
    for number, one in enumerate(failures):
        kinds = FAILURES.get(one.part)
        if kinds is None:
            continue
        if one.kind not in kinds:
            message = f"must be one of {', '.join(kinds)} for a {one.part}, got {shown(one.kind)}"
            yield Issue(("failure", number, "kind"), message)
            continue
        wanted = kinds[one.kind]
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
            message = f"must not be given beside {wanted[0]} {what}"
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


@rule("failure", "control.law")
def _wheels_fail_under_a_sampled_law(failures, law):
    if find_law(law).declaration.sampled:
        return
    for number, one in enumerate(failures):
        if one.part == "wheel":
            yield Issue(
                ("failure", number, "of"),
                f'must name no wheel under the law "{law}", whose torque changes all the time: '
                f"a wheel fails in flight under sampled laws, got {shown(one.of)}",
            )
