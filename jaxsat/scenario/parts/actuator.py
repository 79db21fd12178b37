"""The tables of actuators, made of what these declare, and how failures name them."""

from collections.abc import Sequence
from typing import Any

from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.scenario.quantities import Line, ScenarioTable, Switch, choice, fields_of, table_class


class DeviceTable(ScenarioTable):
    """A table of one device."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)


def table_of_device(actuator: ActuatorDeclaration) -> Any:
    """The class of one table `[[NAME]]` of an actuator."""
    fields = fields_of(actuator.keys) | {"failed": (Switch, choice(actuator.failed, False))}
    doc = f"`[[{actuator.name}]]`: {actuator.summary}."
    return table_class(actuator.name, doc, fields, DeviceTable, "Table")


def names_of(tables: Sequence[Any]) -> list[str]:
    """The name of each table, or its number from 1."""
    return [getattr(one, "name", None) or str(number) for number, one in enumerate(tables, 1)]


def number_of(of: str, actuator: str, tables: Sequence[Any]) -> int | None:
    """Which of an actuator's tables, from 0, "NAME 3" or "NAME name" is; None if there is none.

    Of what has no name, such as torque axes, the number is told.
    """
    kind, _, which = of.partition(" ")
    names = names_of(tables)
    return names.index(which) if kind == actuator and which in names else None
