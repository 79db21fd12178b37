"""Conversion of keys that stand in for others: types of actuators, Euler angles, wheel speeds, and
positions from an origin other than the centre of mass."""

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from jaxsat.scenario.errors import Location
from jaxsat.scenario.parts.named import type_name
from jaxsat.scenario.parts.registry import TABLES, TYPES
from jaxsat.scenario.parts.wheels import SPEEDS
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.units import Conversion, convert_units
from jaxsat.scenario.wording import table_at, validated

POSITIONS = {
    "thruster": ("position_m",),
    "panel": ("centre_m",),
    "disturbance": ("drag_centre_m", "solar_centre_m"),
}
"""Keys of each table that are positions from the centre of mass."""


def converted(data: Mapping[str, Any]) -> Conversion:
    """Return a file's data with canonical keys, in SI.

    Values that cannot be converted are left unchanged for the checks to report.
    """
    conversion = Conversion.of(data)
    convert_units(conversion)
    for name in TABLES:
        _give_types(conversion, name)
    _convert_attitude(conversion)
    _convert_speeds(conversion)
    _convert_positions(conversion.data)
    return conversion


def without_types(scenario: Scenario) -> Scenario:
    """Return the scenario without types, which its actuators have taken over."""
    return scenario.model_copy(update={name: {} for name in TYPES})


def _give_types(conversion: Conversion, name: str) -> None:
    """Copy missing keys from its type to every device; invalid types are left to checks."""
    data, types_name = conversion.data, type_name(name)
    types = dict(_named_tables(data.get(types_name)))
    for location, device in _tables(data, name):
        name_of_type = device.get("type")
        if not isinstance(name_of_type, str) or name_of_type not in types:
            continue
        del device["type"]
        for key, value in types[name_of_type].items():
            if key not in device and key in TYPES[types_name].model_fields:
                device[key] = value
                conversion.places[(*location, key)] = (types_name, name_of_type, key)


def _convert_attitude(conversion: Conversion) -> None:
    """Convert Euler angles or MRP to a quaternion, if no other attitude is given."""
    for location, table in _tables(conversion.data, "initial"):
        angles, sequence, mrp = _values(location, table, "euler_rad", "euler_sequence", "mrp")
        if table.keys() & {"w", "z_rad", "quaternion"}:
            return
        if angles is not None and sequence is not None and "mrp" not in table:
            del table["euler_sequence"]
            quaternion = euler_quaternion(angles, sequence)
            conversion.replace(location, "euler_rad", "quaternion", quaternion)
        elif mrp is not None and not table.keys() & {"euler_rad", "euler_sequence"}:
            conversion.replace(location, "mrp", "quaternion", mrp_quaternion(mrp))


def _convert_speeds(conversion: Conversion) -> None:
    """Convert wheel speeds to momenta, if the rotor inertia is given."""
    for location, table in _tables(conversion.data, "wheel"):
        for speed_key, momentum_key in SPEEDS.items():
            inertia, speed = _values(location, table, "rotor_inertia_kg_m2", speed_key)
            if inertia is not None and speed is not None and momentum_key not in table:
                conversion.replace(location, speed_key, momentum_key, inertia * speed)


def _convert_positions(data: dict[str, Any]) -> None:
    """Convert positions, if there are any, to positions from the centre of mass."""
    for location, spacecraft in _tables(data, "spacecraft"):
        (centre,) = _values(location, spacecraft, "centre_of_mass_m")
        if centre is None:
            continue
        positions = list(_positions(data))
        for table, key, position in positions:
            table[key] = [one - other for one, other in zip(position, centre, strict=True)]
        if positions:
            del spacecraft["centre_of_mass_m"]


def _positions(data: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str, Sequence[float]]]:
    for name, keys in POSITIONS.items():
        for location, table in _tables(data, name):
            for key, position in zip(keys, _values(location, table, *keys), strict=True):
                if position is not None:
                    yield table, key, position


def _named_tables(tables: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, table in tables.items() if isinstance(tables, dict) else ():
        if isinstance(table, dict):
            yield name, table


def _tables(data: Mapping[str, Any], name: str) -> list[tuple[Location, dict[str, Any]]]:
    """The table with this name, or each of a list of them, with its location."""
    value = data.get(name)
    tables = {(name,): value}
    if isinstance(value, list):
        tables = {(name, number): one for number, one in enumerate(value)}
    return [(location, one) for location, one in tables.items() if isinstance(one, dict)]


def _values(location: Location, table: Mapping[str, Any], *keys: str) -> list[Any]:
    """Values of keys, None for absent or invalid ones."""
    table_class = table_at(Scenario, {}, location)
    fields = {} if table_class is None else table_class.model_fields
    return [_value(fields.get(key), table.get(key)) for key in keys]


def _value(field: FieldInfo | None, value: Any) -> Any:
    try:
        return None if field is None or value is None else validated(field, value)
    except ValidationError:
        return None


def euler_quaternion(angles: Sequence[float], sequence: str) -> list[float]:
    """Unit quaternion (4), scalar first, of three rotations (rad) about axes of the turned body.

    `sequence` names these axes in order, such as "zyx".
    """
    turns = (_about("xyz".index(axis), angle) for axis, angle in zip(sequence, angles, strict=True))
    return functools.reduce(_product, turns).tolist()


def _about(axis: int, angle: float) -> np.ndarray:
    quaternion = np.zeros(4)
    quaternion[[0, 1 + axis]] = np.cos(angle / 2), np.sin(angle / 2)
    return quaternion


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rotation `p`, then `q` about the axes that `p` has turned."""
    scalar = p[0] * q[0] - p[1:] @ q[1:]
    return np.array([scalar, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def mrp_quaternion(parameters: Sequence[float]) -> list[float]:
    """Unit quaternion (4), scalar first, of modified Rodrigues parameters e tan(φ/4) (3)."""
    vector = np.array(parameters)
    square = float(vector @ vector)
    return [(1 - square) / (1 + square), *(2 / (1 + square) * vector).tolist()]
