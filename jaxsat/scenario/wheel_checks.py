"""Rules on `[[wheel]]`."""

from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown


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
            'must be "free" beside [[wheel]], whose momenta keep it as they do, got "held"',
        )
