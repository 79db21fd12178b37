"""A scenario as TOML text, and the JSON Schema of scenario files."""

from typing import Any

from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.plugins import (
    ACTUATORS,
    DISTURBANCE,
    ESTIMATOR,
    LAW,
    SENSOR,
    PluginKind,
    installed,
)
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.toml_text import toml_document
from jaxsat.scenario.units import with_units

_PARTS = {
    "ActuatorsTable": ACTUATORS,
    "DisturbanceTorqueTable": DISTURBANCE,
    "EstimatorTable": ESTIMATOR,
    "SensorTable": SENSOR,
}


def dump(scenario: Scenario) -> str:
    """Return the scenario as TOML, defaults written out, that loads to an equal scenario."""
    tables = scenario.model_dump()
    return toml_document({name: table for name, table in tables.items() if table != ()})


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of scenario files; quantities carry their unit under "unit".

    A key may also be given in each of its other units, but only in one. Names of laws and parts are
    those of jaxsat and of installed packages, or "module:Class".
    """
    schema = Scenario.model_json_schema()
    for table, part in _PARTS.items():
        kind = schema["$defs"][table]["properties"]["kind"]
        del kind["type"]
        kind["anyOf"] = _names(part)
    schema["properties"]["control"]["oneOf"].append(_other_law())
    schema = with_units(_for_editors(schema))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _other_law() -> dict[str, Any]:
    about = 'A law that does not come with jaxsat: "module:Class", or an installed one'
    law = {"description": about, "anyOf": _names(LAW), "not": {"enum": list(LAWS)}}
    return {"type": "object", "description": about, "properties": {"law": law}, "required": ["law"]}


def _names(kind: PluginKind) -> list[dict[str, Any]]:
    """Return the alternatives for the name of a part."""
    names = [*kind.own, *sorted(set(installed(kind)) - set(kind.own))]
    return [{"enum": names}] * bool(names) + [{"type": "string", "pattern": ":"}]


def _for_editors(schema: Any) -> Any:
    """Return a schema without null, which TOML does not have, and with a description wherever
    editors look for it: Taplo shows that of alternatives and of the entries of a list alone."""
    if isinstance(schema, list):
        return [_for_editors(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {name: inner for name, inner in schema.items() if inner is not None}
    about = {"description": plain["description"]} if "description" in plain else {}
    if isinstance(plain.get("items"), dict) and "$ref" not in plain["items"]:
        plain["items"] = about | plain["items"]
    for several in {"anyOf", "oneOf"} & set(plain):
        first, *others = [one for one in plain[several] if one != {"type": "null"}]
        if not others:
            del plain[several]
            return _for_editors(first | plain)
        plain[several] = [about | first, *others]
    return {name: _for_editors(inner) for name, inner in plain.items()}
