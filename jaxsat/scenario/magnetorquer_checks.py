"""Rules on `[[magnetorquer]]` and `[unloading]`."""

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.laws import find_law
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.thruster_tables import names_of
from jaxsat.scenario.wording import shown


def _suits(declaration) -> bool:
    """Whether a law commands three torques once a period, of whatever actuators."""
    return declaration.sampled and declaration.torques == 3 and not declaration.allocates


@rule("magnetorquer")
def _magnetorquers_have_names_of_their_own(magnetorquers):
    names = names_of(magnetorquers)
    for number, name in enumerate(names):
        if names.index(name) < number:
            message = f"must be a name of its own, got {shown(name)} again"
            yield Issue(("magnetorquer", number, "name"), message)


@rule("magnetorquer", "control.law")
def _magnetorquers_need_a_law_of_three_torques(magnetorquers, law):
    if magnetorquers and not _suits(find_law(law).declaration):
        allowed = ", ".join(f'"{name}"' for name, one in LAWS.items() if _suits(one.declaration))
        yield at(
            "magnetorquer",
            f'must belong to a sampled law that commands three torques ({allowed}), got "{law}"',
        )


@rule("magnetorquer", "wheel", "thruster", "spacecraft.thruster_torque_axes")
def _something_is_left(magnetorquers, wheels, thrusters, axes):
    others = wheels or thrusters or axes
    if magnetorquers and not others and all(one.failed for one in magnetorquers):
        message = "must leave one that works where there are no wheels and no thrusters"
        yield at("magnetorquer", f"{message}, got {len(magnetorquers)} that have failed")


@rule("magnetorquer", "spacecraft.third_rate")
def _magnetorquers_leave_the_third_rate_free(magnetorquers, third_rate):
    if magnetorquers and third_rate == "held":
        yield at("spacecraft.third_rate", 'must be "free" with [[magnetorquer]], got "held"')


@rule("magnetorquer", "actuators.kind")
def _magnetorquers_go_with_jaxsats_own_actuators(magnetorquers, kind):
    if magnetorquers:
        yield at("actuators", f"must not be given with [[magnetorquer]], got {shown(kind)}")


@rule("unloading.time_constant_s", "magnetorquer", "wheel")
def _unloading_has_both(time, magnetorquers, wheels):
    if not magnetorquers or not wheels:
        missing = " and ".join(
            name
            for name, tables in (("[[wheel]]", wheels), ("[[magnetorquer]]", magnetorquers))
            if not tables
        )
        message = "must belong to wheels and magnetorquers that unload them"
        yield at("unloading", f"{message}, got time_constant_s = {shown(time)} without {missing}")
