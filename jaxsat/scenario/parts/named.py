"""Tables of parts that a scenario names by `kind`, from the declarations of the parts."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, Field, SerializeAsAny, WrapValidator
from pydantic.fields import FieldInfo

from jaxsat.core.declaration.actuator import ActuatorDeclaration, EffectorDeclaration
from jaxsat.core.once import once
from jaxsat.scenario.plugins import ACTUATORS, Part, PluginKind, find_part
from jaxsat.scenario.quantities import (
    STAND_IN,
    Line,
    ScenarioTable,
    Switch,
    choice,
    fields_of,
    table_class,
)


class PartTable(ScenarioTable):
    """Table of a part that does not come with jaxsat, with the keys that the part declares."""

    model_config = ConfigDict(extra="allow", validate_default=True)

    plugin: ClassVar[PluginKind]

    kind: str = choice('The part: "module:Class", or the name of an installed one')


class ActuatorsTable(PartTable):
    """`[actuators]`: actuators that convert the commanded torque, in place of thrusters that make
    it exactly up to their limit."""

    plugin: ClassVar[PluginKind] = ACTUATORS


@once
def table_of_part(base: type[PartTable], part: Part) -> type[PartTable]:
    """Return the class of the table of a part."""

    class Closed(base):
        model_config = ConfigDict(extra="forbid")

    fields: dict[str, Any] = {"kind": (Literal[part.name], choice("The part"))}
    fields |= fields_of(part.declaration.keys)
    doc = f'`kind = "{part.name}"`: {part.declaration.summary}.'
    return table_class(part.name, doc, fields, Closed, "ScenarioTable")


def by_its_kind(base: type[PartTable], own: type[PartTable] | None = None) -> WrapValidator:
    """Return the validator of a table by its kind; `own` is the class for jaxsat's own parts.

    A table without a kind is of class `own`.
    """

    def validate(value: Any, handler: Any) -> Any:
        kind = value.get("kind") if isinstance(value, Mapping) else None
        if (
            own is not None
            and isinstance(value, Mapping)
            and ("kind" not in value or kind in base.plugin.own)
        ):
            return own.model_validate(value)
        if not isinstance(kind, str):
            return handler(value)
        return table_of_part(base, find_part(base.plugin, kind)).model_validate(value)

    return WrapValidator(validate)


ActuatorsOfAKind = Annotated[SerializeAsAny[ActuatorsTable], by_its_kind(ActuatorsTable)]


class DeviceTable(ScenarioTable):
    """Table of one device."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    type: Line | None = choice(
        "The NAME of its type, such as [thruster_type.NAME], whose keys it has", **STAND_IN
    )


def table_of_device(part: EffectorDeclaration) -> Any:
    """Return the class of one table `[[NAME]]` of an actuator, or of a passive part."""
    fields = fields_of(part.keys)
    if isinstance(part, ActuatorDeclaration):
        fields |= {"failed": (Switch, choice(part.failed, False))}
    doc = f"`[[{part.name}]]`: {part.summary}."
    return table_class(part.name, doc, fields, DeviceTable, "Table")


def type_name(name: str) -> str:
    """Name of the table of all types of an actuator."""
    return f"{name}_type"


def table_of_type(name: str, device: type[ScenarioTable]) -> Any:
    """Return the class of a table `[NAME_type.TYPE]`, with every key that devices can share."""
    own = ("name", "type", "failed")
    fields = {key: _optional(one) for key, one in device.model_fields.items() if key not in own}
    doc = f"`[{name}_type.TYPE]`: keys of every [[{name}]] of this type."
    return table_class(f"{name}-type", doc, fields, ScenarioTable, "Table")


def _optional(field: FieldInfo) -> tuple[Any, Any]:
    kind: Any = field.annotation
    for bound in field.metadata:
        kind = Annotated[kind, bound]
    extra = field.json_schema_extra
    return (kind | None, Field(None, description=field.description, json_schema_extra=extra))


def names_of(tables: Sequence[Any]) -> list[str]:
    """Name of each table, or its number from 1."""
    return [getattr(one, "name", None) or str(number) for number, one in enumerate(tables, 1)]


def number_of(of: str, actuator: str, tables: Sequence[Any]) -> int | None:
    """Index, from 0, of the actuator's table that "NAME 3" or "NAME name" denotes, or None.

    Unnamed tables, such as torque axes, are denoted by number.
    """
    kind, _, which = of.partition(" ")
    names = names_of(tables)
    return names.index(which) if kind == actuator and which in names else None
