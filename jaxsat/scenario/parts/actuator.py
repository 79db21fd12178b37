"""How an actuator declares itself to a scenario."""

import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.scenario.quantities import ScenarioTable


@dataclass(frozen=True)
class ActuatorDeclaration:
    """All that a scenario needs to know of a kind of actuator.

    - `name`: of its tables `[[name]]`, and of what fails: "name 3".
    - `table`, `most`: the class of one table, and how many there may be.
    - `meaning`: one line, for the schema.
    - `kinds`: how one of them may fail in flight.
    - `idle`: those that change nothing of one that has failed before the start.
    - `both_signs`: whether what is stuck may be stuck either way.
    - `steered`: whether it takes its part of a command of three torques by a steering of its own.
    - `maker`: "module:Class.method" of the function that makes an `AbstractEffector` of checked
      tables and an `EffectorContext`; None for actuators that are no effector of the body.
      Nothing is imported before it is used.
    """

    name: str
    table: type[ScenarioTable]
    most: int
    meaning: str
    kinds: tuple[AbstractFailureKind, ...]
    idle: tuple[AbstractFailureKind, ...]
    both_signs: bool = False
    steered: bool = False
    maker: str | None = None

    @property
    def from_tables(self) -> Callable[[Sequence[Any], Any], Any] | None:
        """What makes the effector of checked tables and an `EffectorContext`."""
        return None if self.maker is None else pkgutil.resolve_name(self.maker)


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
