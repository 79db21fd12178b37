"""Table of what each actuator of a run did, shares of the torque by kind, and times at limits."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsat.core.declaration.actuator import Signal
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.units import shown_unit
from jaxsat.core.text import capitalised, number_text
from jaxsat.report.document import Cell, Shown, Table
from jaxsat.report.run_plots import part_labels
from jaxsat.report.shares import shares_of
from jaxsat.report.timeline import diagnoses, failures_of_part
from jaxsat.store.labelled import Dataset

STORE = "disc"
"""Shape of a device that stores momentum."""

AT_LIMIT = 1 - 1e-6
"""Fraction of a limit from which a device counts as at the limit."""

MARKS = (0.9, 1.0)
"""Fractions of a limit whose first times are reported."""

TREND = 0.1
"""Largest deviation from a straight line, over its rise, for a trend."""

LEAST_RISE = 0.01
"""Least rise of a trend, over the limit, in the second half of a run."""


def first_time(
    time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], level: float
) -> float | None:
    """Return the first saved time (s) at which the size of `values` is at a level, or None."""
    places = np.flatnonzero(np.abs(values) >= AT_LIMIT * level)
    return float(time[places[0]]) if len(places) else None


def full_at_trend(
    time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], limit: float
) -> float | None:
    """Extrapolate the time (s) at which the size of `values` reaches its limit.

    The trend is the least-squares line of the second half of the run; None where it does not rise,
    or does not fit.
    """
    later = time >= (time[0] + time[-1]) / 2
    if np.count_nonzero(later) < 3:
        return None
    clock, sizes = time[later] - time[-1], np.abs(values[later])
    slope, end = np.polyfit(clock, sizes, 1)
    rise = -slope * clock[0]
    if rise < LEAST_RISE * limit or np.abs(sizes - end - slope * clock).max() > TREND * rise:
        return None
    return float(time[-1] + (limit - end) / slope)


def saturation_sentences(dataset: Dataset, scenario: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence on each device that came near the limit of its storage, or soon will."""
    time = dataset["time"].values
    stores = ((kind, one) for kind in ACTUATORS for one in kind.signals if one.shape == STORE)
    for kind, signal in stores:
        if signal.name not in dataset:
            continue
        labels, tables = part_labels(dataset, signal.name), scenario.get(kind.name, ())
        for label, table, values in zip(
            labels, tables, dataset[signal.name].values.T, strict=False
        ):
            limit = table.get(signal.limit)
            text = _state(time, values, limit) if limit else ""
            if text:
                yield f"{capitalised(kind.called)} {label} {text}."


def _state(time: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"], limit: float) -> str:
    """Describe how a history approaches its limit; empty where that is far."""
    near, full = (first_time(time, values, part * limit) for part in MARKS)
    full_time = full_at_trend(time, values, limit) if full is None else None
    texts = []
    if near is not None:
        texts.append(f"held 90 % of its limit from {number_text(near, 6)} s")
    if full is not None:
        texts.append(f"was full at {number_text(full, 6)} s")
    if full_time is not None:
        texts.append(
            f"will be full at {number_text(full_time, 3)} s by the trend of the second half"
        )
    return " and ".join(texts)


FATES = "failure", "diagnosis"
"""Headings of the last columns."""


def share_sentence(dataset: Dataset) -> Iterator[str]:
    """Yield a sentence on each kind's share of ∫|T| dt, with the propellant; none for one kind."""
    shares = shares_of(dataset)
    if shares is None:
        return
    spans = np.diff(dataset["time"].values)
    impulses = {
        name: float(spans @ np.linalg.norm(torque, axis=1)[:-1]) for name, torque in shares.items()
    }
    whole = sum(impulses.values())
    if not whole > 0:
        return
    texts = [
        f"{number_text(100 * one / whole, 3, scale=1e3)} % by {name}"
        for name, one in impulses.items()
    ]
    propellant = used_propellant(dataset)
    fuel = f", with {number_text(propellant, 3)} kg of propellant" if propellant > 0 else ""
    yield f"Torque over the run: {', '.join(texts)}{fuel}."


def used_propellant(dataset: Dataset) -> float:
    """Return the propellant used in a run, kg; 0 without thrusters that use any."""
    if "propellant" not in dataset:
        return 0.0
    return float(np.nanmax(dataset["propellant"].values, initial=0.0))


def actuator_tables(dataset: Dataset, scenario: Mapping[str, Any]) -> Iterator[Table]:
    """Yield the table of what each device did, how it failed, and what the law found.

    Each number has a column with its unit; cells of devices without it are empty.
    """
    rows: list[dict[str, Cell]] = []
    verdicts = diagnoses(dataset)
    for kind in ACTUATORS:
        signals = [one for one in kind.signals if one.each and one.name in dataset]
        labels = part_labels(dataset, signals[0].name) if signals else []
        tables = {
            str(table.get("name", number)): table
            for number, table in enumerate(scenario.get(kind.name, ()), 1)
        }
        for place, label in enumerate(labels):
            own = label if label in tables else label.rstrip("+-")  # a way of a two-sided thruster
            table = tables.get(own, {})
            row: dict[str, Cell] = {"actuator": f"{kind.name} {label}".replace("_", " ")}
            for one in signals:
                noun = one.name.removeprefix(f"{kind.name}_").replace("_", " ")
                row |= _numbers(dataset, one, noun, place, table)
            failed = failures_of_part(scenario, f"{kind.name} {own}", dataset["time"].values)
            row["failure"] = "failed before the start" if table.get("failed") else failed
            row["diagnosis"] = verdicts.get(f"{kind.name} {label}", "")
            rows.append(row)
    if rows:
        names = dict.fromkeys(name for row in rows for name in row if name not in FATES)
        columns = [*names, *(name for name in FATES[: 1 + bool(verdicts)])]
        cells = [[row.get(name) for name in columns] for row in rows]
        yield Table("What each actuator did", columns, cells)


def _numbers(
    dataset: Dataset, signal: Signal, noun: str, place: int, table: Mapping[str, Any]
) -> dict[str, Cell]:
    """Return the cells of one device's signal by heading: start, end, peak, seconds, or count."""
    values, time = dataset[signal.name].values[:, place], dataset["time"].values
    if signal.mean:
        return {"at full thrust (s)": _shown(np.diff(time) @ values[:-1])}
    if signal.total:
        return {"openings": int(values[-1])}
    if not signal.peak:
        return {}
    most, unit = float(np.nanmax(np.abs(values))), shown_unit(signal.units)
    parts = {"at the start": values[0], "at the end": values[-1], "at most": most}
    cells: dict[str, Cell] = {
        f"{noun} {when} ({unit})": _shown(value, most) for when, value in parts.items()
    }
    if limit := table.get(signal.limit):
        cells["of its limit (%)"] = _shown(100 * most / limit)
        if signal.shape == STORE:
            times = {f"{100 * part:.0f} % at (s)": part for part in MARKS}
            times_at = {
                name: first_time(time, values, part * limit) for name, part in times.items()
            }
            cells |= {name: _shown(at, digits=6) for name, at in times_at.items() if at is not None}
    return cells


def _shown(value: Any, scale: float = 0.0, digits: int = 3) -> Shown:
    """Return a number displayed with few digits and sorted by its full value."""
    return Shown(number_text(float(value), digits, scale=scale), float(value))
