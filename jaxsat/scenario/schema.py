"""The scenario: all values of one run, validated once, with units in the names of its keys."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any

from annotated_types import Len
from pydantic import BaseModel, ValidationError, create_model, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails, PydanticCustomError

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.declaration.laws import Law
from jaxsat.scenario import checks as _checks  # noqa: F401  (declares the rules)
from jaxsat.scenario.control import ControlTable
from jaxsat.scenario.dispersion_tables import DispersionTable
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.disturbances import DisturbanceTable, PanelTable
from jaxsat.scenario.parts.estimator import EstimatorOfAKind
from jaxsat.scenario.parts.failures import FailureTable
from jaxsat.scenario.parts.named import ActuatorsOfAKind
from jaxsat.scenario.parts.orbit import OrbitTable
from jaxsat.scenario.parts.registry import TABLES, TYPES
from jaxsat.scenario.parts.requirements import RequirementTable
from jaxsat.scenario.parts.sensors import TABLES as SENSORS
from jaxsat.scenario.parts.sensors import OneSensor, SamplingTable
from jaxsat.scenario.parts.thrusters import ModulationTable
from jaxsat.scenario.parts.wheels import UnloadingTable
from jaxsat.scenario.quantities import Line, ScenarioTable, Text, choice, table_with
from jaxsat.scenario.rules import broken_rules
from jaxsat.scenario.tables import InitialTable, SettledTable, SimulationTable, SpacecraftTable
from jaxsat.scenario.tuning import TuningTable
from jaxsat.scenario.wording import issue_of, item_kind, table_at, validated


class _Body(ScenarioTable):
    """Tables of a scenario before its actuators."""

    title: Line = choice("Title of the scenario, in one line")
    description: Text = choice("What the scenario shows", "")
    spacecraft: SpacecraftTable = choice("The rigid body and its thrusters")
    orbit: OrbitTable = choice("The orbit")
    disturbance: DisturbanceTable = choice("Disturbance torques", DisturbanceTable())
    actuators: ActuatorsOfAKind | None = choice("Actuators that do not come with jaxsat", None)


_PARTS = {
    one.name: (Annotated[tuple[TABLES[one.name], ...], Len(0, one.most)], choice(one.meaning, ()))
    for one in PARTS
}
_TYPES = {
    name: (dict[str, table], choice("Keys that several have in common, by types", {}, exclude=True))
    for name, table in TYPES.items()
}


class Scenario(table_with(_TYPES | _PARTS | SENSORS, _Body)):
    """One spacecraft, its control law and one run.

    Raises pydantic's `ValidationError` holding every mistake at once. Each of its errors carries
    the `Issue` under `ctx["issue"]`; `jaxsat.scenario.read` turns them into lines of the file. With
    the validation context `{"law": False}` rules that concern the control law are left out.
    """

    unloading: UnloadingTable | None = choice(
        "How magnetorquers take momentum out of wheels; by default its keys have their defaults",
        None,
    )
    panel: Annotated[tuple[PanelTable, ...], Len(0, 1000)] = choice(
        "Flat plates that sunlight strikes, and air where disturbance.drag_density_kg_m3 is above "
        "0, in place of the constant areas",
        (),
    )
    modulation: ModulationTable | None = choice("How [[thruster]] are pulsed", None)
    failure: Annotated[tuple[FailureTable, ...], Len(0, 100)] = choice(
        "Failures in flight, of which the law has no knowledge", ()
    )
    initial: InitialTable = choice("The state at the start")
    control: ControlTable = choice("The control law")
    simulation: SimulationTable = choice("How to integrate and what to save")
    settled: SettledTable = choice("When a case counts as settled", SettledTable())
    requirement: Annotated[tuple[RequirementTable, ...], Len(0, 1000)] = choice(
        "What a run must show", ()
    )
    sampling: SamplingTable | None = choice("Sensors and delay of a sampled law", None)
    sensor: dict[str, OneSensor] = choice(
        "Sensors of vectors that do not come with jaxsat, by names of your own", {}
    )
    estimator: EstimatorOfAKind | None = choice(
        "Estimator that gives the law attitude and rates from these sensors", None
    )
    dispersion: DispersionTable | None = choice("What a Monte-Carlo study disperses", None)
    tuning: TuningTable | None = choice("Which gains are tuned, and how", None)

    @property
    def law(self) -> Law:
        """The control law that `control.law` names."""
        return self.control.declared

    @model_validator(mode="wrap")
    @classmethod
    def _all_mistakes_at_once(
        cls, data: Any, handler: Callable[[Any], Any], info: Any
    ) -> "Scenario":
        if isinstance(data, cls):
            return data
        scenario, issues = None, []
        try:
            scenario = handler(data)
            values = flattened(scenario)
        except ValidationError as error:
            lines = [issue_of(cls, data, line) for line in error.errors()]
            issues = [issue for issue in lines if issue is not None]
            values = readable_values(cls, data)
        issues = [*issues, *broken_rules(values, (info.context or {}).get("law", True))]
        if scenario is None or issues:
            lines = [_error_details(issue) for issue in issues]
            raise ValidationError.from_exception_data("Scenario", lines)
        return scenario


def flattened(table: BaseModel, prefix: str = "") -> dict[str, Any]:
    """Values by dotted key, including those of nested tables."""
    values: dict[str, Any] = {}
    for name in type(table).model_fields:
        values.update(_flatten(getattr(table, name), prefix + name))
    return values


def _flatten(value: Any, key: str) -> dict[str, Any]:
    """Value by its dotted key, or values by dotted keys for a table that is not empty."""
    if isinstance(value, BaseModel):
        return flattened(value, f"{key}.")
    if not isinstance(value, dict) or not value:
        return {key: value}
    values: dict[str, Any] = {}
    for name, inner in value.items():
        values.update(_flatten(inner, f"{key}.{name}"))
    return values


def readable_values(table: type[BaseModel], data: Any, prefix: str = "") -> dict[str, Any]:
    """Individually valid values of a table that is invalid as a whole."""
    values: dict[str, Any] = {}
    for name, field in table.model_fields.items():
        present = isinstance(data, Mapping) and name in data
        if not present and field.is_required():
            continue
        try:
            value = validated(field, data[name]) if present else field.get_default()
        except ValidationError:
            inner = _as_a_class(table_at(table, data, (name,)), field, data[name])
            if inner is not None and isinstance(data[name], Mapping):
                values.update(readable_values(inner, data[name], f"{prefix}{name}."))
            continue
        values.update(_flatten(value, prefix + name))
    return values


def _as_a_class(
    table: type[BaseModel] | None, field: FieldInfo, data: Any
) -> type[BaseModel] | None:
    """Table class of a field; a class made for the present keys if keys may have any name."""
    kind = item_kind(field.annotation)
    if table is not None or kind is None or not isinstance(data, Mapping):
        return table
    fields: dict[str, Any] = {str(name): (kind, ...) for name in data}
    return create_model("Items", **fields)


def issues_of(error: ValidationError) -> list[Issue]:
    """Return the issues of a refused scenario."""
    return [line["ctx"]["issue"] for line in error.errors()]  # pyright: ignore


def _error_details(issue: Issue) -> InitErrorDetails:
    context = {"message": issue.message, "issue": issue}
    return InitErrorDetails(
        type=PydanticCustomError("scenario", "{message}", context), loc=issue.location, input=None
    )
