"""What each actuator of a run did, a row for each, and the torque that every kind of them made."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from jaxsat.core.declaration.actuator import Signal
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.text import number_text
from jaxsat.report.document import Cell, Table
from jaxsat.report.run_plots import part_labels, shown_unit
from jaxsat.report.shares import shares_of

AT_LIMIT = 1 - 1e-6
"""The part of a limit from which on a device counts as being at it."""


def share_sentence(dataset: xr.Dataset) -> Iterator[str]:
    """The parts of the torque over time, ∫|T| dt, of every kind of actuator, with the propellant;
    nothing where one kind makes it all."""
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
    texts = [f"{100 * one / whole:.3g} % by {name}" for name, one in impulses.items()]
    used = float(dataset["propellant"].max()) if "propellant" in dataset else 0.0
    fuel = f", with {number_text(used, 3)} kg of propellant" if used > 0 else ""
    yield f"Torque over the run: {', '.join(texts)}{fuel}."


def actuator_tables(
    dataset: xr.Dataset, scenario: Mapping[str, Any], failures: Sequence[tuple[float, str]]
) -> Iterator[Table]:
    """What each device did and how it failed; none without signals of single devices."""
    rows: list[list[Cell]] = []
    for kind in ACTUATORS:
        signals = [one for one in kind.signals if one.each and one.name in dataset]
        labels = part_labels(dataset[signals[0].name]) if signals else []
        tables = {
            str(table.get("name", number)): table
            for number, table in enumerate(scenario.get(kind.name, ()), 1)
        }
        for place, label in enumerate(labels):
            own = label if label in tables else label.rstrip("+-")  # a way of a two-sided thruster
            table = tables.get(own, {})
            texts = [_did(dataset, one, place, table) for one in signals]
            fate = _fate(f"{kind.name} {own}", failures)
            fate = "failed before the start" if table.get("failed") else fate
            name = f"{kind.name} {label}".replace("_", " ")
            rows.append([name, "; ".join(filter(None, texts)), fate])
    if rows:
        yield Table("What each actuator did", ["actuator", "did", "failure"], rows)


def _did(dataset: xr.Dataset, signal: Signal, place: int, table: Mapping[str, Any]) -> str:
    """What a signal says of one device: start, end and peak, seconds, or a count."""
    values, unit = dataset[signal.name].values[:, place], shown_unit(signal.units)
    if signal.peak:
        most = float(np.nanmax(np.abs(values)))
        first, last = (number_text(float(values[one]), 3, scale=most) for one in (0, -1))
        text = f"{first} to {last} {unit}, at most {number_text(most, 3)}"
        limit = table.get(signal.limit)
        if not limit:
            return text
        full = np.flatnonzero(np.abs(values) >= AT_LIMIT * limit)
        if signal.shape == "disc" and len(full):
            return f"{text}, full at {number_text(float(dataset['time'][full[0]]), 6)} s"
        return f"{text}, {100 * most / limit:.3g} % of its limit"
    if signal.mean:
        seconds = float(np.diff(dataset["time"].values) @ values[:-1])
        return f"{number_text(seconds, 3)} s at full thrust"
    return f"{values[-1]:.0f} openings" if signal.total else ""


def _fate(name: str, failures: Sequence[tuple[float, str]]) -> str:
    """How it failed in flight, such as "dead at 300 s"."""
    own = [(at, what) for at, what in failures if what.startswith(f"{name} ")]
    return "; ".join(f"{what.removeprefix(name).strip()} at {at:g} s" for at, what in own)
