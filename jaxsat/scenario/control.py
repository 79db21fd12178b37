"""`[control]`: the laws that a scenario can name, and the table of the keys of each."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union

from pydantic import ConfigDict, Field, SerializeAsAny, WrapValidator

from jaxsat.core.declaration.laws import LAWS, Law
from jaxsat.core.errors import ArgumentError
from jaxsat.core.once import once
from jaxsat.core.ranges import ORBIT_RATE
from jaxsat.scenario.plugins import LAW, PluginError, find_class, installed, require_constants
from jaxsat.scenario.quantities import (
    Inertia,
    Number,
    Relation,
    ScenarioTable,
    Switches3,
    choice,
    fields_of,
    quantity,
    table_class,
    within,
)


def law_names() -> tuple[str, ...]:
    """Names of all laws that a scenario can use; jaxsat's own take precedence."""
    return (*LAWS, *sorted(set(installed(LAW)) - set(LAWS)))


def is_plugin(name: str) -> bool:
    """Whether the name denotes a law that does not come with jaxsat."""
    return name not in LAWS and (":" in name or name in installed(LAW))


def find_law(name: str) -> Law:
    """Return the law that a scenario names.

    Raises `PluginError` for a law that does not come with jaxsat and cannot be used, and `KeyError`
    for an unknown name.
    """
    if name in LAWS:
        return LAWS[name]
    if not is_plugin(name):
        raise KeyError(name)
    controller, place = find_class(LAW, name)
    law = Law(name, controller.declaration, place)
    _require_true(law)
    require_constants(LAW, law)
    return law


def known_law(name: Any) -> Law | None:
    """Return the law with this name; None if there is no usable law."""
    try:
        return find_law(name) if isinstance(name, str) else None
    except (KeyError, PluginError):
        return None


def required_law(name: str, allowed: str) -> Law:
    """Return the law that an argument `law` names.

    Raises `ArgumentError` with the reason for an unusable law, and with the `allowed` values for an
    unknown name.
    """
    try:
        return find_law(name)
    except PluginError as error:
        raise ArgumentError("law", str(error)) from None
    except KeyError:
        raise ArgumentError("law", f"must be {allowed}", name) from None


def _require_true(law: Law) -> None:
    """Raise `PluginError` if a class contradicts its declaration."""
    from jaxsat.control.controller import AbstractBacksteppingLaw
    from jaxsat.control.sampled import AbstractSampledController

    if issubclass(law.controller, AbstractSampledController) and not law.declaration.sampled:
        rule = "must name a sampled law that declares the key period_s"
        raise PluginError(LAW, f"{rule}, got {law.name} without")
    for declares, what, parent in (
        (law.declaration.sampled, "the key period_s", AbstractSampledController),
        (law.declaration.tracks_rates, "tracks_rates", AbstractBacksteppingLaw),
    ):
        if declares and not issubclass(law.controller, parent):
            rule = f"must name a law that declares {what} only if it is a subclass of"
            raise PluginError(LAW, f"{rule} {parent.__name__}, got {law.name} with it")


class ModelTable(ScenarioTable):
    """`[control.model]`: the controller's model of the plant; by default it equals the plant."""

    inertia_kg_m2: Inertia | None = quantity(
        "Inertia that the controller believes, in either form of spacecraft.inertia_kg_m2",
        "kg m²",
        None,
    )
    orbit_rate_rad_s: Annotated[Number, within(ORBIT_RATE)] | None = quantity(
        "Orbital rate that the controller believes", "rad/s", None
    )
    orbit_relation: Relation | None = choice("Form of (11) that the controller uses", None)


class LawTable(ScenarioTable):
    """`[control]`, whatever the law."""

    model_config = ConfigDict(validate_default=True)  # declared defaults may be invalid

    declared: ClassVar[Law]
    """The law to which this table belongs."""

    law: str = choice("The control law")

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Value of a key that the law declares."""


@once
def table_of(law: Law) -> type[LawTable]:
    """Class of the `[control]` table of a law."""
    what = law.declaration.summary.partition("\n\n")[0].rstrip(".")
    fields: dict[str, Any] = {"law": (Literal[law.name], choice(f'"{law.name}": {what}'))}
    fields |= fields_of(law.declaration.keys)
    if law.declaration.measures_disturbance:
        fields["measured_disturbance"] = (
            Switches3,
            choice(
                "Axes x, y, z whose periodic disturbance the controller measures and feeds forward",
                (False, False, False),
            ),
        )
    if law.declaration.has_model:
        what = "What the controller believes of the plant"
        fields["model"] = (ModelTable, choice(what, ModelTable()))
    doc = f'`law = "{law.name}"`: {law.declaration.summary}.'
    table = table_class(law.name, doc, fields, LawTable, "ScenarioTable")
    table.declared = law
    return table


def _by_its_law(value: Any, handler: Callable[[Any], Any]) -> Any:
    """Validate the table of a law that does not come with jaxsat; leave others to the handler."""
    law = value.get("law") if isinstance(value, Mapping) else None
    if isinstance(value, LawTable):
        return value
    if isinstance(law, str) and is_plugin(law):
        return table_of(find_law(law)).model_validate(value)
    return handler(value)


if TYPE_CHECKING:
    ControlTable = LawTable
else:
    ControlTable = Annotated[
        Union[tuple(table_of(law) for law in LAWS.values())],  # noqa: UP007  (made of a tuple)
        Field(discriminator="law"),
        SerializeAsAny(),
        WrapValidator(_by_its_law),
    ]
