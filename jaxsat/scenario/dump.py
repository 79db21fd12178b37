"""A scenario as TOML text, and the JSON Schema of scenario files."""

from typing import Any

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.toml_text import toml_document
from jaxsat.scenario.units import with_units

_OTHER_LAW = {
    "type": "object",
    "description": 'A law that does not come with jaxsat: "module:Class", or an installed one',
    "properties": {"law": {"type": "string", "not": {"enum": list(LAWS)}}},
    "required": ["law"],
}


def dump(scenario: Scenario) -> str:
    """Return the scenario as TOML, defaults written out, that loads to an equal scenario."""
    tables = scenario.model_dump()
    return toml_document({name: table for name, table in tables.items() if table != ()})


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files; quantities carry their unit under "unit".

    A key may also be given in each of its other units, but only in one.
    """
    schema = with_units(Scenario.model_json_schema())
    schema["properties"]["control"]["oneOf"].append(_OTHER_LAW)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
