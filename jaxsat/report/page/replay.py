"""Data of the 3-D replay of a run: body, actuators, attitude and phases."""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxsat.core.declaration.actuator import Signal
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.failures import ONE_WAY
from jaxsat.report.timeline import failures_of, mode_names
from jaxsat.scenario.control import known_law
from jaxsat.store.labelled import Dataset

MOST_SAMPLES = 20_000
"""Largest number of attitude samples; longer runs are thinned evenly."""

THINNEST = 0.12
"""Least side of the body, over the longest one."""


def craft(dataset: Dataset, scenario: Mapping[str, Any], title: str) -> dict[str, Any]:
    """Return one spacecraft and its motion; arrays are base64 of little-endian floats."""
    count = dataset.sizes["time"]
    every = -(-count // MOST_SAMPLES)
    samples = np.unique(np.append(np.arange(0, count, every), count - 1))
    data = dataset.isel(time=samples)
    axes, half = body_box(scenario)
    thrusters, columns = _thrusters(scenario, data)
    half = _around(half, axes, thrusters)
    law = known_law(scenario.get("control", {}).get("law"))
    return {
        "title": title,
        "time": _encode(data["time"].values, "<f8"),
        "quaternion": _encode(data["quaternion"].values, "<f8"),
        "error": _encode(data["pointing_error_total"].values, "<f4"),
        "torque": _encode(_scale(data["torque"].values), "<f4"),
        "half": half.tolist(),
        "axes": axes.tolist(),
        "thrusters": thrusters,
        "levels": None if columns is None else _encode(np.nan_to_num(columns), "<f4"),
        "devices": [
            _along_axes(scenario, data, actuator.name, signal)
            for actuator in ACTUATORS
            for signal in actuator.signals
            if signal.shape is not None and scenario.get(actuator.name)
        ],
        "phases": phases_of(dataset),
        "failures": [
            {"what": what, "at": at} for at, what in failures_of(scenario, dataset["time"].values)
        ],
        "target": law is None or law.declaration.regulates_attitude,
        "thinned": int(every),
    }


def body_box(scenario: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return principal axes (rows, body axes) and half sides of a uniform box with this inertia.

    The longest half side is 1, as the mass is unknown. A body that no box can have gets a thin
    side.
    """
    inertia = np.array(scenario.get("spacecraft", {}).get("inertia_kg_m2", (1.0, 1.0, 1.0)), float)
    matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
    moments, axes = np.linalg.eigh(matrix)
    if np.allclose(matrix, np.diag(np.diag(matrix))):
        moments, axes = np.diag(matrix), np.eye(3)
    squares = moments.sum() / 2 - moments
    sides = np.sqrt(np.maximum(squares, 0.0))
    sides = sides / sides.max() if sides.max() > 0 else np.ones(3)
    return axes.T, np.maximum(sides, THINNEST)


def phases_of(dataset: Dataset) -> list[dict[str, Any]]:
    """Return the phases of the law in order: name, start and end, s."""
    names, time = mode_names(dataset), dataset["time"].values
    if len(names) < 2:
        return []
    mode = dataset["mode"].values
    begins = np.concatenate([[0], 1 + np.flatnonzero(mode[1:] != mode[:-1])])
    ends = [*begins[1:], len(time) - 1]
    return [
        {"name": names[int(mode[begin])], "start": float(time[begin]), "end": float(time[end])}
        for begin, end in zip(begins, ends, strict=True)
        if np.isfinite(mode[begin]) and int(mode[begin]) in names
    ]


def _failures_of_part(
    scenario: Mapping[str, Any], kind: str, name: str, failed: bool, way: int = 1
) -> list[dict[str, Any]]:
    """Return the failures of a part in order of time (s), each replacing the one before.

    The part may have `failed` before the start. Stuck and leaking kinds do not affect the way -1 of
    a two-sided thruster.
    """
    if failed:
        return [{"at": 0.0, "kind": "failed"}]
    failures = [
        {"at": float(table.get("at_s", 0.0)), "kind": str(table.get("kind", ""))}
        for table in scenario.get("failure", ())
        if str(table.get("of", "")) == f"{kind} {name}"
        and (way > 0 or table.get("kind") not in [kind.text for kind in ONE_WAY])
    ]
    return sorted(failures, key=lambda one: one["at"])


def _thrusters(
    scenario: Mapping[str, Any], data: Dataset
) -> tuple[list[dict[str, Any]], np.ndarray | None]:
    """Return the thrusters to draw, and the level of each (times, n) or None."""
    tables = scenario.get("thruster", ())
    if not tables:
        return _ideal_thrusters(scenario), None
    level = data["thrust_level"].values if "thrust_level" in data else None
    working = sum(1 + bool(one.get("two_sided")) for one in tables if not one.get("failed"))
    has_levels = level is not None and level.shape[1] == working
    thrusters, column = [], 0
    for place, table in enumerate(tables, 1):
        name = str(table.get("name", place))
        failed = bool(table.get("failed"))
        for sign in (1, -1)[: 1 + bool(table.get("two_sided"))]:
            force = _unit(table.get("direction"), sign)
            thrusters.append(
                {
                    "name": name,
                    "position": table.get("position_m"),
                    "force": force,
                    "axis": _torque_axis(table, sign),
                    "failures": _failures_of_part(scenario, "thruster", name, failed, sign),
                    "column": column if has_levels and not failed else None,
                }
            )
            column += not failed
    return thrusters, level if has_levels else None


def _ideal_thrusters(scenario: Mapping[str, Any]) -> list[dict[str, Any]]:
    spacecraft = scenario.get("spacecraft", {})
    failed_numbers = spacecraft.get("failed_thrusters", ())
    return [
        {
            "name": str(place),
            "position": None,
            "force": None,
            "axis": _unit(axis, 1),
            "failures": _failures_of_part(
                scenario, "thruster", str(place), place in failed_numbers
            ),
            "column": None,
        }
        for place, axis in enumerate(spacecraft.get("thruster_torque_axes") or (), 1)
    ]


def _torque_axis(table: Mapping[str, Any], sign: int) -> list[float] | None:
    if table.get("torque_axis") is not None:
        return _unit(table["torque_axis"], sign)
    if table.get("position_m") is None or table.get("direction") is None:
        return None
    return _unit(np.cross(table["position_m"], table["direction"]), sign)


def _along_axes(
    scenario: Mapping[str, Any], data: Dataset, kind: str, signal: Signal
) -> dict[str, Any]:
    """Return devices to draw, and their signal (times, n) over its limit.

    Signals without a limit are over their largest value.
    """
    tables, parts, levels = scenario[kind], [], None
    for place, table in enumerate(tables, 1):
        name = str(table.get("name", place))
        failures = _failures_of_part(scenario, kind, name, bool(table.get("failed")))
        parts.append({"name": name, "axis": _unit(table.get("axis"), 1), "failures": failures})
    if signal.name in data and data[signal.name].values.shape[1] == len(tables):
        values = data[signal.name].values
        largest = np.nanmax(np.abs(values), initial=0.0) or 1.0
        limits = np.array([float(table.get(signal.limit) or largest) for table in tables])
        levels = _encode(np.nan_to_num(values / limits), "<f4")
    return {"kind": kind, "shape": signal.shape, "parts": parts, "levels": levels}


def _around(
    half: np.ndarray, axes: np.ndarray, thrusters: Sequence[Mapping[str, Any]]
) -> np.ndarray:
    """Scale the box to metres where thrusters have positions, so that they lie on it or in it."""
    places = [one["position"] for one in thrusters if one["position"] is not None]
    if not places:
        return half
    inside = np.abs(np.array(places, float) @ axes.T) / half
    scale = float(inside.max())
    return half * scale if scale > 0 else half


def _scale(values: np.ndarray) -> np.ndarray:
    """Scale values by their 99th percentile, clipped to -1 to 1."""
    sizes = np.abs(values[np.isfinite(values)])
    usual = float(np.percentile(sizes, 99)) if len(sizes) else 0.0
    usual = usual or (float(sizes.max()) if len(sizes) else 0.0) or 1.0
    return np.clip(np.nan_to_num(values) / usual, -1.0, 1.0)


def _unit(vector: Any, sign: int) -> list[float] | None:
    if vector is None:
        return None
    length = float(np.linalg.norm(vector))
    return (sign * np.asarray(vector, float) / length).tolist() if length > 0 else None


def _encode(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
