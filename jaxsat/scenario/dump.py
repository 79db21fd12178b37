"""A scenario as TOML text and its schema as JSON."""

from typing import Any

from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.toml_text import toml_document


def dump(scenario: Scenario) -> str:
    """The scenario as a TOML file, defaults written out, that loads to an equal scenario."""
    return toml_document(scenario.model_dump())


def json_schema() -> dict[str, Any]:
    """The JSON Schema of scenario files; quantities carry their unit under "unit"."""
    schema = Scenario.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}
