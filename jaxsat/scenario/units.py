"""Units besides SI: `omega_deg_s` or `omega_rpm` may stand in for `omega_rad_s`; and the original
places of converted keys."""

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
    """The converted data, issues, and the location in the file of each new location."""

    data: dict[str, Any]
    issues: list[Issue]
    places: dict[Location, Location]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Conversion":
        """Return an unconverted deep copy of the data."""
        return cls(copy.deepcopy(dict(data)), [], {})

    def replace(self, location: Location, old: str, new: str, value: Any) -> None:
        """Replace an old key of a table by a new key with this value."""
        table: Any = self.data
        for part in location:
            table = table[part]
        del table[old]
        table[new] = value
        self.places[(*location, new)] = (*location, old)

    def as_written(self, issue: Issue) -> Issue:
        """Return an issue in terms of the keys that the user wrote."""
        location = self._user_location(issue.location)
        involved = tuple(map(self._user_location, issue.involved))
        message, converted = self._with_own_keys(issue), self._converted(issue.location)
        if converted and converted[-1] not in location:
            message = f"{message} (read as {converted[-1]})"
        return dataclasses.replace(issue, location=location, involved=involved, message=message)

    def _with_own_keys(self, issue: Issue) -> str:
        """Return the message with each converted key named as in the file.

        A key without its table belongs to one of the tables that the issue is about.
        """
        tables = {_dotted(one[:-1]) for one in (issue.location, *issue.involved)}
        own = {_dotted(new): str(self._user_location(new)[-1]) for new in self.places}

        def named(match: re.Match[str]) -> str:
            table, key = match[1], match[2]
            places = [table] if table else [f"{one}." for one in tables]
            spelling = next((own[one + key] for one in places if one + key in own), key)
            return match[0] if spelling == key else f"{table}{spelling} (read as {key})"

        return re.sub(r"\b((?:\w+\.)*)(\w+)\b", named, issue.message)

    def _converted(self, location: Location) -> Location:
        """Longest beginning of a location that was converted from another in the file, or ()."""
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
    """A unit that a key may end with: its name, and its size in the SI unit."""

    name: str
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
    "_sqrt_Hz": {},  # of any other density, which is no frequency
    "_rad_s2_sqrt_Hz": {"_deg_s2_sqrt_Hz": KeyUnit("deg/s²/√Hz", DEGREE)},
}
"""Key endings in SI, and the alternative endings of each."""

_SI_OF = {one: si for si, units in UNITS.items() for one in (si, *units)}
"""SI ending of every ending."""

PURE_NUMBERS = frozenset({"weights"})
"""Keys of a distribution that are not in the unit of the dispersed quantity."""

KEYS_OF_THE_LAW = (("tuning", "parameters"), ("tuning", "smoothing"))
"""Tables with the same keys as `[control]`."""


def spellings(key: str) -> tuple[str, ...]:
    """The key in each of its units, SI first; only the key itself if it has no others."""
    ending = _ending(key)
    si = _SI_OF.get(ending)
    if si is None:
        return (key,)
    return tuple(key.removesuffix(ending) + other for other in (si, *UNITS[si]))


def _ending(key: str) -> str:
    """Longest known ending of a key, as `_sqrt_Hz` is no `_Hz`; empty without one."""
    return max(filter(key.endswith, _SI_OF), key=len, default="")


def other_spellings(key: str) -> Iterator[str]:
    """The key in each of its other units."""
    return (one for one in spellings(key) if one != key)


def _unit(key: str) -> KeyUnit:
    """Unit of a key that is not in SI."""
    ending = _ending(key)
    return UNITS[_SI_OF[ending]][ending]


def convert_units(conversion: Conversion) -> None:
    """Convert all keys in another unit to the SI key of the same table.

    A key that a table declares by its own name is left unchanged.
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
    """Replace a key by its SI key, unless the table already has that."""
    si = spellings(name)[0]
    if si not in table:
        conversion.replace(location, name, si, _scaled(table[name], _unit(name).size))
        return
    other = conversion.places.get((*location, si), (*location, si))
    message = f"must not be given with {other[-1]}, got {shown(table.pop(name))}"
    conversion.issues.append(Issue((*location, name), message, (other,)))


def _scaled(value: Any, size: float) -> Any:
    """Scale the numbers of a value, of the entries of a list, or of a distribution."""
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
    """Return a JSON Schema in which every key may be given in each of its units, but only in one.

    A table with a type requires no key, as its type may have them all.
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
    alternatives = [_any_of(family) for family in families if family[0] in required]
    only_one = [{"oneOf": [*_each(one), {"not": _any_of(one)}]} for one in families]
    if "type" not in properties:
        return result | _rules(plain, [*only_one, *alternatives])
    without_type = {"if": {"not": {"required": ["type"]}}, "then": _rules(plain, alternatives)}
    return result | _rules([], only_one) | without_type


def _rules(required: list[str], rules: list[dict[str, Any]]) -> dict[str, Any]:
    """Required keys and rules of a table; empty without any, as lists must not be empty."""
    parts = {"required": required, "allOf": rules}
    return {name: part for name, part in parts.items() if part}


def _each(family: tuple[str, ...]) -> list[dict[str, Any]]:
    return [{"required": [key]} for key in family]


def _any_of(family: tuple[str, ...]) -> dict[str, Any]:
    """Schema that requires a key in any of its units."""
    return {"anyOf": _each(family)}


def _in_unit(entry: Any, key: str, unit: KeyUnit) -> Any:
    """Schema of an SI key, converted to another unit."""
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
        text = f"In place of {key} ({unit.name})"
        result |= {"unit": unit.name, "description": text, "in_place_of": key}
    return result
