"""Tables of all kinds of actuators, and the rules for each of them."""

from collections.abc import Mapping

from jaxsat.core.declaration.actuator import ActuatorDeclaration, EffectorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS, EFFECTORS, PARTS
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.declaration.laws import LAWS
from jaxsat.core.text import suggestion
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import names_of, table_of_device, table_of_type, type_name
from jaxsat.scenario.parts.thrusters import ThrusterTable
from jaxsat.scenario.parts.wheels import WheelTable
from jaxsat.scenario.quantities import ScenarioTable
from jaxsat.scenario.rules import RULES, at, declared_rule, rule, rule_over
from jaxsat.scenario.wording import shown

TABLES: Mapping[str, type[ScenarioTable]] = {
    **{one.name: table_of_device(one) for one in PARTS},
    "thruster": ThrusterTable,
    "wheel": WheelTable,
}
"""Class of one table of an actuator or of a passive part, by its name."""

TYPES = {type_name(name): table_of_type(name, table) for name, table in TABLES.items()}
"""Class of one type of an actuator, by the name of the table of types."""

AXES = "spacecraft.thruster_torque_axes"


def _declare_rules(part: EffectorDeclaration) -> None:
    """Register the rules of every actuator and of every passive part."""
    name = part.name

    @rule(name)
    def _names_differ(tables):
        names = names_of(tables)
        for number, one in enumerate(names):
            if names.index(one) < number:
                message = f"must be a name of its own, got {shown(one)} again"
                yield Issue((name, number, "name"), message)

    @rule_over(name)
    def _types_exist(values):
        prefix = f"{type_name(name)}."
        types = {key.split(".")[1]: None for key in values if key.startswith(prefix)}
        for number, one in enumerate(values[name]):
            if one.type is not None:
                among = f"one of {', '.join(types)}" if types else f"the TYPE of a [{prefix}TYPE]"
                message = f"must be {among}, got {shown(one.type)}{suggestion(one.type, types)}"
                yield Issue((name, number, "type"), message)

    @rule(name, "spacecraft.third_rate")
    def _third_rate_is_free(tables, third_rate):
        if tables and part in EFFECTORS and third_rate == "held":
            yield at("spacecraft.third_rate", f'must be "free" with [[{name}]], got "held"')

    for declared in part.rules:
        RULES.append(declared_rule(declared))


def _declare_rules_of_actuator(actuator: ActuatorDeclaration) -> None:
    """Register the additional rules of every kind of actuator."""
    name = actuator.name

    @rule(name, "actuators.kind")
    def _actuators_are_those_of_jaxsat(tables, kind):
        if tables:
            yield at("actuators", f"must not be given with [[{name}]], got {shown(kind)}")

    @rule(name, "control.law")
    def _law_commands_three_torques(tables, law):
        if tables and actuator.steering and not suits(actuator, law.declaration):
            own = ", which commands thrusters, wheels and magnetorquers alone"
            names = (f'"{name}"' for name, one in LAWS.items() if suits(actuator, one.declaration))
            yield at(
                name,
                "must belong to a sampled law that commands three torques "
                f'({", ".join(names)}), got "{law}"'
                f"{own if law.declaration.commands_actuators else ''}",
            )

    @rule_over(*(one.name for one in ACTUATORS), AXES)
    def _something_is_left(values):
        tables = values[name]
        others = values[AXES] or any(values[one.name] for one in ACTUATORS if one is not actuator)
        if actuator.steering and tables and not others and all(one.failed for one in tables):
            message = "must leave one that works where there is no other actuator"
            yield at(name, f"{message}, got {len(tables)} that have failed")


def suits(actuator: ActuatorDeclaration, declaration: LawDeclaration) -> bool:
    """Whether a law takes an actuator with a steering of its own: it commands three torques once a
    period, of any actuators or also of this one."""
    commands = not declaration.commands_actuators or actuator.name in declaration.steers
    return declaration.sampled and declaration.torques == 3 and commands


for _one in PARTS:
    _declare_rules(_one)
for _actuator in ACTUATORS:
    _declare_rules_of_actuator(_actuator)
