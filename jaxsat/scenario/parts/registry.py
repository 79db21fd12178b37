"""The actuators that a scenario can have, and the rules that hold for each of them."""

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.actuator import ActuatorDeclaration, names_of
from jaxsat.scenario.parts.gimbals import GIMBAL
from jaxsat.scenario.parts.magnetorquers import MAGNETORQUER
from jaxsat.scenario.parts.thrusters import THRUSTER
from jaxsat.scenario.parts.wheels import WHEEL
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown

ACTUATORS: tuple[ActuatorDeclaration, ...] = (THRUSTER, WHEEL, MAGNETORQUER, GIMBAL)
"""In the order in which the body has them."""

STEERED = tuple(one.name for one in ACTUATORS if one.steered)
"""Those that have a steering of their own."""

EFFECTORS = tuple(one for one in ACTUATORS if one.maker is not None)
"""Those that are effectors of the body."""


def _declare_rules(actuator: ActuatorDeclaration) -> None:
    """Register what holds for every kind of actuator."""
    name = actuator.name

    @rule(name)
    def _names_differ(tables):
        names = names_of(tables)
        for number, one in enumerate(names):
            if names.index(one) < number:
                message = f"must be a name of its own, got {shown(one)} again"
                yield Issue((name, number, "name"), message)

    @rule(name, "actuators.kind")
    def _actuators_are_those_of_jaxsat(tables, kind):
        if tables:
            yield at("actuators", f"must not be given with [[{name}]], got {shown(kind)}")

    @rule(name, "spacecraft.third_rate")
    def _third_rate_is_free(tables, third_rate):
        if tables and actuator.maker is not None and third_rate == "held":
            yield at("spacecraft.third_rate", f'must be "free" with [[{name}]], got "held"')

    @rule(name, "control.law")
    def _law_commands_three_torques(tables, law):
        if tables and actuator.steered and not _suits(law.declaration):
            names = (f'"{name}"' for name, one in LAWS.items() if _suits(one.declaration))
            yield at(
                name,
                "must belong to a sampled law that commands three torques "
                f'({", ".join(names)}), got "{law}"',
            )


def _suits(declaration) -> bool:
    """Whether a law commands three torques once a period, of whatever actuators."""
    return declaration.sampled and declaration.torques == 3 and not declaration.commands_actuators


for _one in ACTUATORS:
    _declare_rules(_one)
