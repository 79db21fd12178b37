"""`[disturbance]`, `[[panel]]`: torques that no actuator makes."""

from typing import Annotated, ClassVar

from annotated_types import Ge, Le
from pydantic import SerializeAsAny

from jaxsat.core.declaration.disturbances import AERODYNAMIC, DISTURBANCES, SOLAR
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import PartTable, by_its_kind
from jaxsat.scenario.plugins import DISTURBANCE, PluginKind
from jaxsat.scenario.quantities import (
    Direction,
    Line,
    Number,
    Position3,
    ScenarioTable,
    choice,
    fields_of,
    quantity,
    table_with,
)
from jaxsat.scenario.rules import RULES, at, declared_rule, rule, rule_over
from jaxsat.scenario.wording import shown


class DisturbanceTorqueTable(PartTable):
    """`[disturbance.torques.NAME]`: a disturbance that does not come with jaxsat."""

    plugin: ClassVar[PluginKind] = DISTURBANCE


OneDisturbance = Annotated[
    SerializeAsAny[DisturbanceTorqueTable], by_its_kind(DisturbanceTorqueTable)
]


class DisturbanceTable(
    table_with(fields_of(key for part in DISTURBANCES.values() for key in part.keys))
):
    """`[disturbance]`: torques that no thruster makes."""

    torques: dict[str, OneDisturbance] = choice(
        "Disturbances that do not come with jaxsat, by names of your own", {}
    )


Share = Annotated[Number, Ge(0), Le(1)]


class PanelTable(ScenarioTable):
    """`[[panel]]`: one flat plate, struck on the side of its normal."""

    name: Line | None = choice("Name of the panel, for display", None)
    area_m2: Annotated[Number, Ge(0), Le(1e6)] = quantity("Area", "m²")
    normal: Direction = quantity("Direction of its outward normal, body axes", "1")
    centre_m: Position3 = quantity("Its centre, from the centre of mass, body axes", "m")
    drag_coefficient: Annotated[Number, Ge(0), Le(100)] = quantity("Drag coefficient", "1", 2.2)
    specular: Share = quantity("Share of light that it reflects as a mirror", "1", 0.0)
    diffuse: Share = quantity("Share of light that it reflects evenly", "1", 0.0)


ONE_COEFFICIENT = {
    f"disturbance.{key.name}": key.default
    for key in (*AERODYNAMIC.keys, *SOLAR.keys)
    if key.name.startswith(("drag", "solar")) and "density" not in key.name
}
"""Keys of the one-coefficient models that panels replace, and their defaults."""


@rule_over("panel", *ONE_COEFFICIENT)
def _panels_stand_for_the_constant_areas(values):
    for number, one in enumerate(values["panel"]):
        if one.specular + one.diffuse > 1:
            message = f"must be at most 1 with specular = {shown(one.specular)}"
            yield Issue(("panel", number, "diffuse"), f"{message}, got {shown(one.diffuse)}")
    for key, default in ONE_COEFFICIENT.items():
        if values["panel"] and values[key] != default:
            yield at(key, f"must be omitted with [[panel]], got {shown(values[key])}")


@rule("disturbance.solar_area_m2", "disturbance.sun_direction", "panel")
def _sun_has_a_direction(area, direction, panels):
    if (area or panels) and not any(direction):
        yield at("disturbance.sun_direction", "must be a direction, got zeros")


for _part in DISTURBANCES.values():
    RULES.extend(map(declared_rule, _part.rules))
