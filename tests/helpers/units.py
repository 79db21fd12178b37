"""A scenario in other units of mass, length and time, by the units that its keys declare."""

import re
from typing import Any

import numpy as np
from pydantic import BaseModel

from jaxsat.scenario.schema import Scenario

POWERS = {
    **dict.fromkeys(("1", "rad"), (0, 0, 0)),
    "kg": (1, 0, 0),
    "m": (0, 1, 0),
    "s": (0, 0, 1),
    "N": (1, 1, -2),
    "Hz": (0, 0, -1),
    "A": (0, 0, 0),
}
"""Powers of mass, length and time in a unit."""

KEPT = ("specific_impulse_s",)
"""Of propellant alone."""


def powers(unit: str) -> np.ndarray:
    """Those of "N m s", "√(rad/s)" or "rad/s/√Hz"."""
    root = re.fullmatch(r"√\((.*)\)", unit)
    if root:
        return powers(root[1]) / 2
    total, sign = np.zeros(3), 1
    for part in unit.split("/"):
        for word in part.split():
            power = {"²": 2, "³": 3}.get(word[-1], 1) / (2 if word[0] == "√" else 1)
            total += sign * power * np.array(POWERS[word.strip("√²³")])
        sign = -1
    return total


def in_units(scenario: Scenario, units: tuple[float, float, float]) -> Scenario:
    """The same motion where kilogram, metre and second are so many new units."""
    return Scenario.model_validate(_scaled(scenario, np.array(units)), context={"law": True})


def _scaled(table: BaseModel, units: np.ndarray) -> dict[str, Any]:
    found = {}
    for name, field in type(table).model_fields.items():
        value, extra = getattr(table, name), field.json_schema_extra
        if isinstance(value, BaseModel):
            value = _scaled(value, units)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            value = [_scaled(one, units) for one in value]
        elif value is not None and np.any(value) and name not in KEPT:
            unit = extra.get("unit", "1") if isinstance(extra, dict) else "1"
            if unit != "1":
                value = (np.array(value) * np.prod(units ** powers(str(unit)))).tolist()
        if value is not None:
            found[name] = value
    return found
