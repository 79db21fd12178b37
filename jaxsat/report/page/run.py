"""The section of one run: verdict, replay, plots, numbers, scenario, provenance."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from jaxsat.core.text import capitalised
from jaxsat.report.document import (
    Chart,
    Charts,
    Document,
    Facts,
    Lines,
    Listing,
    Replay,
    Table,
)
from jaxsat.report.facts import (
    provenance_facts,
    scenario_facts,
    scenario_tables,
)
from jaxsat.report.page.charts import MOST_LINES, TimePlots, shown_unit
from jaxsat.report.page.replay import craft
from jaxsat.report.run_document import failures_of, run_document, until_end
from jaxsat.report.signal_figures import BOUND, further_signals
from jaxsat.report.time_axes import mode_names
from jaxsat.store.dataset import coarseness
from jaxsat.store.labels import PARTS

GROUPS = {
    "Attitude": ("pointing_error_total", "pointing_error", "euler_angle", "w", "z"),
    "Rates": ("omega", "relative_rate", "rate_error"),
    "Torque": ("torque", "constraint_torque", "disturbance"),
    "Control law": ("lyapunov", "mode"),
}
"""Signals by heading; those that are not named stand under `FURTHER`."""

FURTHER = "Actuators and sensors"

TITLES = {
    "pointing_error_total": "Total pointing error",
    "pointing_error": "Pointing error about body axes",
    "euler_angle": "Euler angles 3-2-1",
    "w": "Tilt w",
    "z": "Turn z",
    "omega": "Angular velocity ω",
    "relative_rate": "Rate relative to the orbit frame",
    "rate_error": "Rate minus its reference",
    "torque": "Torque",
    "constraint_torque": "Ideal torque that holds the third rate",
    "disturbance": "Disturbance torque",
    "lyapunov": "Lyapunov function",
    "mode": "Phase of the control law",
}
"""Others go by their long name."""

LOGARITHMIC = frozenset({"pointing_error_total", "lyapunov"})
STEPS = frozenset({"mode", "valve_openings"})
MUTE = frozenset({"constraint_torque", "disturbance", "rate_error", "z", "lyapunov"})
"""Signals without which the page is as clear where they are zero or unknown throughout."""


def run_section(dataset: xr.Dataset, name: str, command: str = "") -> Document:
    """What the dataset of a run has to say; `name` is where it came from."""
    scenario = scenario_tables(dataset)
    told = run_document(dataset, name)
    dataset = _named_parts(until_end(dataset), scenario)
    failures = failures_of(scenario, dataset["time"].values)
    plots = TimePlots(dataset["time"].values, failures) if len(dataset["time"]) > 1 else None
    blocks: list[Any] = [Facts("Scenario", scenario_facts(scenario))]
    if plots is not None:
        blocks.append(Replay("3-D replay", [craft(dataset, scenario, told.title)]))
        blocks += run_charts(dataset, plots)
    blocks += [
        *told.blocks,
        extremes(dataset),
        provenance_facts(dataset.attrs, command),
        Listing("Scenario file", str(dataset.attrs.get("scenario", "")), "scenario.toml"),
    ]
    if note := coarseness(dataset):
        blocks.insert(1, Lines("Note", [f"{capitalised(note)}."]))
    return dataclasses.replace(told, blocks=blocks, kind=f"Run in {name}", plots=plots)


def _named_parts(dataset: xr.Dataset, scenario: Mapping[str, Any]) -> xr.Dataset:
    """With the names that the scenario gives to actuators in place of numbers."""
    for kind in PARTS:
        names = [str(table.get("name", n)) for n, table in enumerate(scenario.get(kind, ()), 1)]
        if dataset.sizes.get(kind) == len(names) == len(set(names)):
            dataset = dataset.assign_coords({kind: names})
    return dataset


def run_charts(dataset: xr.Dataset, plots: TimePlots) -> list[Charts]:
    """The plots of a run under their headings, the time window first."""
    groups = {**GROUPS, FURTHER: tuple(further_signals(dataset))}
    error = dataset["pointing_error_total"]
    overview = plots.overview(error.values, "Total pointing error", "degree")
    found = [Charts("Time window", [overview])]
    for heading, names in groups.items():
        made = [one for name in names for one in _signal_charts(dataset, name, plots)]
        if made:
            found.append(Charts(heading, made))
    return found


def _signal_charts(dataset: xr.Dataset, name: str, plots: TimePlots) -> list[Chart]:
    """The plots of one signal: none where it is not there or says nothing."""
    if name not in dataset:
        return []
    variable = dataset[name]
    values = variable.values.reshape(len(dataset["time"]), -1)
    if name in MUTE and not np.nan_to_num(values).any():
        return []
    if name == "mode" and len(mode_names(dataset)) < 2:
        return []
    title = TITLES.get(name) or capitalised(str(variable.attrs.get("long_name", name)))
    unit = str(variable.attrs.get("units", "1"))
    labels = [_label(name, part) for part in _parts(variable)]
    if name == "torque" and "torque_max" in dataset:
        return _torque_charts(dataset, labels, plots)
    if len(labels) > MOST_LINES:
        return [plots.strips(values, labels, title=title, unit=unit)]
    bands = {}
    if name + BOUND in dataset:
        bound = dataset[name + BOUND].values.reshape(values.shape)
        bands = {column: (-bound[:, column], bound[:, column]) for column in range(len(labels))}
    options: dict[str, Any] = {"log": name in LOGARITHMIC, "steps": name in STEPS, "bands": bands}
    chart = plots.lines(values, labels, title=title, unit=unit, **options)
    if name == "mode":
        names = mode_names(dataset)
        chart.figure.yaxis.ticker = list(names)
        chart.figure.yaxis.major_label_overrides = dict(names)
    return [chart]


def _torque_charts(dataset: xr.Dataset, labels: list[str], plots: TimePlots) -> list[Chart]:
    """One plot an axis where the torque changes between the saved times: mean and range."""
    low, high, mean = (dataset[f"torque_{part}"].values for part in ("min", "max", "mean"))
    return [
        plots.lines(
            mean[:, [axis]],
            [f"mean {label}"],
            title=f"Torque {label}: mean and range until the next saved time",
            unit="N m",
            bands={0: (low[:, axis], high[:, axis])},
        )
        for axis, label in enumerate(labels)
        if np.nan_to_num(high[:, axis] - low[:, axis]).any() or np.nan_to_num(mean[:, axis]).any()
    ]


def _parts(variable: xr.DataArray) -> list[str]:
    return [""] if variable.ndim == 1 else [str(one) for one in variable[variable.dims[1]].values]


def _label(name: str, part: str) -> str:
    symbol = {"omega": "ω", "torque": "T", "pointing_error": "about ", "quaternion": ""}.get(name)
    if not part:
        return name.replace("_", " ")
    if name == "w" or name == "euler_angle":
        return part
    return part if symbol is None else f"{symbol}{part}"


def extremes(dataset: xr.Dataset) -> Table:
    """Least, largest and last value of every signal, which the plots draw."""
    rows = []
    for name, variable in dataset.data_vars.items():
        if variable.dims[:1] != ("time",):
            continue
        values = variable.values.reshape(len(dataset["time"]), -1)
        for part, column in zip(_parts(variable), values.T, strict=True):
            good = column[np.isfinite(column)]
            if len(good):
                unit = str(variable.attrs.get("units", "1"))
                numbers = (float(good.min()), float(good.max()), float(good[-1]))
                label = part if part.startswith(str(name)) else f"{name} {part}".strip()
                rows.append([label, shown_unit(unit), *numbers])
    note = "At the saved times, not decimated."
    return Table("Numbers", ["signal", "unit", "least", "largest", "at the end"], rows, note)
