"""Tables of parts that a scenario names by `kind`, from the declarations of the parts."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import ConfigDict, SerializeAsAny, WrapValidator

from jaxsat.core.once import once
from jaxsat.scenario.plugins import ACTUATORS, Part, PluginKind, find_part
from jaxsat.scenario.quantities import ScenarioTable, choice, fields_of, table_class


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
