"""Angles in degrees: KEY_deg and KEY_deg_s may stand in place of KEY_rad and KEY_rad_s."""

import copy
import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import shown, table_at

SUFFIXES = {"_deg": "_rad", "_deg_s": "_rad_s"}

PURE_NUMBERS = frozenset({"weights"})
"""Keys of a distribution that are not in the unit of what is dispersed."""


class InRadians(NamedTuple):
    """A scenario's data without degrees, what was wrong with them, and where they were."""

    data: dict[str, Any]
    issues: list[Issue]
    places: dict[Location, Location]

    def as_written(self, issue: Issue) -> Issue:
        """An issue about the keys that the user wrote."""
        location = self._user_location(issue.location)
        involved = tuple(map(self._user_location, issue.involved))
        message = issue.message
        if location != issue.location:
            message = f"{message} (in radians, of the degrees given)"
        return dataclasses.replace(issue, location=location, involved=involved, message=message)

    def _user_location(self, location: Location) -> Location:
        for end in range(len(location), 0, -1):
            place = self.places.get(location[:end])
            if place is not None:
                return (*place, *location[end:])
        return location


def other_spellings(key: str) -> Iterator[str]:
    """The same key in the other unit of angles, if it has one."""
    for degrees, radians in SUFFIXES.items():
        for mine, other in ((degrees, radians), (radians, degrees)):
            if key.endswith(mine):
                yield key.removesuffix(mine) + other


def in_radians(data: Mapping[str, Any]) -> InRadians:
    """Take in all keys in degrees that stand for one in radians of the same table.

    A key that a table declares by its own name is left as it is.
    """
    result = InRadians(copy.deepcopy(dict(data)), [], {})
    _convert(result, data, result.data, ())
    return result


def _convert(
    conversion: InRadians, root: Mapping[str, Any], table: dict[str, Any], location: Location
) -> None:
    table_class = table_at(Scenario, root, location)
    own = {} if table_class is None else table_class.model_fields
    for name in list(table):
        if isinstance(table[name], dict):
            _convert(conversion, root, table[name], (*location, name))
        radians = next((key for key in other_spellings(name) if key in own), None)
        if name in own or radians is None:
            continue
        place = (*location, name)
        if radians in table:
            message = f"must not be given with {radians}, got {shown(table[name])}"
            conversion.issues.append(Issue(place, message, ((*location, radians),)))
            del table[name]
        else:
            table[radians] = _radians(table.pop(name))
            conversion.places[*location, radians] = place


def _radians(value: Any) -> Any:
    """The numbers of a value, of the entries of a list, or of a distribution."""
    if isinstance(value, list | tuple):
        return [_radians(entry) for entry in value]
    if isinstance(value, dict):
        return {
            name: inner if name in PURE_NUMBERS else _radians(inner)
            for name, inner in value.items()
        }
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return math.radians(value) if plain else value


def with_degrees(schema: Any) -> Any:
    """A JSON Schema in which every key in radians may also be given in degrees, but not in both."""
    if isinstance(schema, list):
        return [with_degrees(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    result = {name: with_degrees(inner) for name, inner in schema.items()}
    properties = result.get("properties")
    if not isinstance(properties, dict):
        return result
    twins = {
        key: twin
        for key in properties
        for twin in other_spellings(key)
        if key.endswith(tuple(SUFFIXES.values())) and twin not in properties
    }
    if not twins:
        return result
    required = result.get("required", [])
    result["properties"] = properties | {
        twin: _in_degrees(properties[key], key) for key, twin in twins.items()
    }
    result["required"] = [key for key in required if key not in twins]
    result["allOf"] = [
        {"oneOf": [{"required": [key]}, {"required": [twin]}]}
        if key in required
        else {"not": {"required": [key, twin]}}
        for key, twin in twins.items()
    ]
    return result


def _in_degrees(entry: Any, key: str) -> Any:
    """The entry of a key in radians, for the same in degrees."""
    if isinstance(entry, list):
        return [_in_degrees(one, key) for one in entry]
    if not isinstance(entry, dict):
        return entry
    bounds = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    result = {name: _in_degrees(inner, key) for name, inner in entry.items() if name != "default"}
    for name in bounds:
        if isinstance(result.get(name), int | float):
            result[name] = math.degrees(result[name])
    if "unit" in result:
        unit = result["unit"].replace("rad", "deg")
        result |= {"unit": unit, "description": f"In place of {key} ({unit})"}
    return result
