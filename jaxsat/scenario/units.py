"""Units besides those of SI: `omega_deg_s` or `omega_rpm` may stand in place of `omega_rad_s`;
and where keys came from that a scenario is checked by."""

import copy
import dataclasses
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wording import shown, table_at


class Conversion(NamedTuple):
    """The data so far, what was wrong with them, and for each new place that in the file."""

    data: dict[str, Any]
    issues: list[Issue]
    places: dict[Location, Location]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Conversion":
        """The data before anything is converted, a copy."""
        return cls(copy.deepcopy(dict(data)), [], {})

    def replace(self, location: Location, old: str, new: str, value: Any) -> None:
        """Put a value under a new key of a table in place of an old key."""
        table: Any = self.data
        for part in location:
            table = table[part]
        del table[old]
        table[new] = value
        self.places[(*location, new)] = (*location, old)

    def as_written(self, issue: Issue) -> Issue:
        """An issue about the keys that the user wrote."""
        location = self._user_location(issue.location)
        involved = tuple(map(self._user_location, issue.involved))
        message, converted = self._with_own_keys(issue), self._converted(issue.location)
        if converted and converted[-1] not in location:
            message = f"{message} (read as {converted[-1]})"
        return dataclasses.replace(issue, location=location, involved=involved, message=message)

    def _with_own_keys(self, issue: Issue) -> str:
        """The message, in which each key that the user wrote otherwise is named as in the file.

        A key without its table belongs to one of the tables that the issue is about.
        """
        tables = {_dotted(one[:-1]) for one in (issue.location, *issue.involved)}
        own = {_dotted(new): str(old[-1]) for new, old in self.places.items()}

        def named(match: re.Match[str]) -> str:
            table, key = match[1], match[2]
            places = [table] if table else [f"{one}." for one in tables]
            place = next((one for one in places if one + key in own), None)
            if place is None:
                return match[0]
            written = own[place + key]
            while place + written in own:
                written = own[place + written]
            return f"{table}{written} (read as {key})"

        return re.sub(r"\b((?:\w+\.)*)(\w+)\b", named, issue.message)

    def _converted(self, location: Location) -> Location:
        """The beginning of a location that is none in the file; nothing if it is one."""
        ends = range(len(location), 0, -1)
        return next((location[:end] for end in ends if location[:end] in self.places), ())

    def _user_location(self, location: Location) -> Location:
        converted = self._converted(location)
        if not converted:
            return location
        return self._user_location((*self.places[converted], *location[len(converted) :]))


def _dotted(location: Location) -> str:
    """Names of tables and keys; entries of arrays are alike."""
    return ".".join(part for part in location if isinstance(part, str))


class KeyUnit(NamedTuple):
    """A unit that a key may have at its end: what it is called, and its size in the unit of SI."""

    called: str
    size: float


DEGREE = math.pi / 180
ARCSECOND = DEGREE / 3600

UNITS: Mapping[str, Mapping[str, KeyUnit]] = {
    "_rad": {"_deg": KeyUnit("deg", DEGREE), "_arcsec": KeyUnit("arcsec", ARCSECOND)},
    "_rad_s": {
        "_deg_s": KeyUnit("deg/s", DEGREE),
        "_deg_h": KeyUnit("deg/h", ARCSECOND),
        "_rpm": KeyUnit("rpm", 2 * math.pi / 60),
        "_Hz": KeyUnit("Hz", 2 * math.pi),
    },
    "_rad_s2": {"_deg_s2": KeyUnit("deg/s²", DEGREE)},
    "_rad_s_sqrt_Hz": {
        "_deg_s_sqrt_Hz": KeyUnit("deg/s/√Hz", DEGREE),
        "_deg_sqrt_h": KeyUnit("deg/√h", DEGREE / 60),
    },
    "_T": {"_nT": KeyUnit("nT", 1e-9)},
    "_rad_s2_sqrt_Hz": {"_deg_s2_sqrt_Hz": KeyUnit("deg/s²/√Hz", DEGREE)},
}
"""The endings of keys in SI, and the endings that may stand in place of each."""

_SI_OF = {one: si for si, units in UNITS.items() for one in (si, *units)}
"""The ending in SI of every ending."""

PURE_NUMBERS = frozenset({"weights"})
"""Keys of a distribution that are not in the unit of what is dispersed."""

KEYS_OF_THE_LAW = (("tuning", "parameters"), ("tuning", "smoothing"))
"""Tables whose keys are those of `[control]`."""


def spellings(key: str) -> tuple[str, ...]:
    """The key with each unit that it may have, that of SI first; only itself if it has no other."""
    ending = _ending(key)
    si = _SI_OF.get(ending)
    if si is None:
        return (key,)
    return tuple(key.removesuffix(ending) + other for other in (si, *UNITS[si]))


def _ending(key: str) -> str:
    """The longest ending that a key has, as `_sqrt_Hz` is no `_Hz`; empty without one."""
    return max(filter(key.endswith, _SI_OF), key=len, default="")


def other_spellings(key: str) -> Iterator[str]:
    """A key as it is spelt in its other units."""
    return (one for one in spellings(key) if one != key)


def _unit(key: str) -> KeyUnit:
    """The unit of a key that is not in SI."""
    ending = _ending(key)
    return UNITS[_SI_OF[ending]][ending]


def convert_units(conversion: Conversion) -> None:
    """Take in all keys in another unit that stand for one in SI of the same table.

    A key that a table declares by its own name is left as it is.
    """
    _convert(conversion, copy.deepcopy(conversion.data), conversion.data, ())


def _convert(
    conversion: Conversion, root: Mapping[str, Any], node: Any, location: Location
) -> None:
    if isinstance(node, list):
        for number, entry in enumerate(node):
            _convert(conversion, root, entry, (*location, number))
    if not isinstance(node, dict):
        return
    place = ("control",) if location in KEYS_OF_THE_LAW else location
    table_class = table_at(Scenario, root, place)
    own = {} if table_class is None else table_class.model_fields
    for name in list(node):
        _convert(conversion, root, node[name], (*location, name))
        if name not in own and spellings(name)[0] in own:
            _convert_key(conversion, node, location, name)


def _convert_key(
    conversion: Conversion, table: dict[str, Any], location: Location, name: str
) -> None:
    """Replace a key by that in SI, unless the table has it already."""
    si = spellings(name)[0]
    if si not in table:
        conversion.replace(location, name, si, _scaled(table[name], _unit(name).size))
        return
    other = conversion.places.get((*location, si), (*location, si))
    message = f"must not be given with {other[-1]}, got {shown(table.pop(name))}"
    conversion.issues.append(Issue((*location, name), message, (other,)))


def _scaled(value: Any, size: float) -> Any:
    """The numbers of a value, of the entries of a list, or of a distribution, times a size."""
    if isinstance(value, list | tuple):
        return [_scaled(entry, size) for entry in value]
    if isinstance(value, dict):
        return {
            name: inner if name in PURE_NUMBERS else _scaled(inner, size)
            for name, inner in value.items()
        }
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return value * size if plain else value


def with_units(schema: Any) -> Any:
    """A JSON Schema in which every key may be given in each of its units, but only in one.

    A table with a type needs no key, as its type may have them all.
    """
    if isinstance(schema, list):
        return [with_units(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    result = {name: with_units(inner) for name, inner in schema.items()}
    properties = result.get("properties")
    if not isinstance(properties, dict):
        return result
    families = [family for family in map(spellings, properties) if len(family) > 1]
    families = [family for family in families if family[0] in properties]
    result["properties"] = properties | {
        key: _in_unit(properties[si], si, _unit(key))
        for si, *others in families
        for key in others
        if key not in properties
    }
    required = result.pop("required", [])
    plain = [key for key in required if len(spellings(key)) == 1]
    needed = [_any_of(family) for family in families if family[0] in required]
    only_one = [{"oneOf": [*_each(one), {"not": _any_of(one)}]} for one in families]
    if "type" not in properties:
        return result | _rules(plain, [*only_one, *needed])
    without_type = {"if": {"not": {"required": ["type"]}}, "then": _rules(plain, needed)}
    return result | _rules([], only_one) | without_type


def _rules(required: list[str], rules: list[dict[str, Any]]) -> dict[str, Any]:
    """What a table must have and obey; nothing where there is nothing, as lists are not empty."""
    parts = {"required": required, "allOf": rules}
    return {name: part for name, part in parts.items() if part}


def _each(family: tuple[str, ...]) -> list[dict[str, Any]]:
    return [{"required": [key]} for key in family]


def _any_of(family: tuple[str, ...]) -> dict[str, Any]:
    """That a key is there, in any of its units."""
    return {"anyOf": _each(family)}


def _in_unit(entry: Any, key: str, unit: KeyUnit) -> Any:
    """The entry of a key in SI, for the same in another unit."""
    if isinstance(entry, list):
        return [_in_unit(one, key, unit) for one in entry]
    if not isinstance(entry, dict):
        return entry
    bounds = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")
    result = {
        name: _in_unit(inner, key, unit) for name, inner in entry.items() if name != "default"
    }
    for name in bounds:
        if isinstance(result.get(name), int | float):
            result[name] /= unit.size
    if "unit" in result:
        text = f"In place of {key} ({unit.called})"
        result |= {"unit": unit.called, "description": text, "in_place_of": key}
    return result
