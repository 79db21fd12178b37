"""Section of one run: verdict, replay, plots, numbers, scenario, provenance."""

import dataclasses
from typing import Any

import numpy as np

from jaxsat.core.declaration.units import shown_unit
from jaxsat.core.text import capitalised
from jaxsat.report.actuator_table import actuator_tables
from jaxsat.report.document import Charts, Document, Facts, Lines, Listing, ReplayScene, Table
from jaxsat.report.facts import provenance_facts, scenario_facts, scenario_tables
from jaxsat.report.page.plots import TimeWindow, chart_of, overview_of
from jaxsat.report.page.replay import craft
from jaxsat.report.plot import Plot, Timeline
from jaxsat.report.run_document import run_document, until_end
from jaxsat.report.run_plots import (
    attitude_plots,
    further_signals,
    part_labels,
    pointing_plots,
    signal_plots,
    torque_plots,
)
from jaxsat.report.shares import share_plots
from jaxsat.report.timeline import failures_of
from jaxsat.store.dataset import coarseness
from jaxsat.store.labelled import Dataset


def run_section(dataset: Dataset, name: str, command: str = "") -> Document:
    """Return the section of a run's dataset; `name` is its origin."""
    scenario = scenario_tables(dataset)
    document = run_document(dataset, name)
    dataset = until_end(dataset)
    times, window = dataset["time"].values, None
    failures = failures_of(scenario, times)
    blocks: list[Any] = [
        *actuator_tables(dataset, scenario),
        Facts("Scenario", scenario_facts(scenario)),
    ]
    if len(times) > 1:
        window = TimeWindow(Timeline(times, failures))
        blocks.append(ReplayScene("3-D replay", [craft(dataset, scenario, document.title)]))
        blocks.append(Charts("Time window", [overview_of(pointing_plots(dataset)[0], window)]))
        for heading, plots in _plots(dataset).items():
            charts = [chart_of(plot, window) for plot in plots]
            blocks += [Charts(heading, charts)] if charts else []
    blocks += [
        *document.blocks,
        extremes(dataset),
        provenance_facts(dataset.attrs, command),
        Listing("Scenario file", str(dataset.attrs.get("scenario", "")), "scenario.toml"),
    ]
    if note := coarseness(dataset):
        blocks.insert(1, Lines("Note", [f"{capitalised(note)}."]))
    return dataclasses.replace(document, blocks=blocks, kind=f"Run in {name}", plots=window)


def _plots(dataset: Dataset) -> dict[str, list[Plot]]:
    def of(*names: str) -> list[Plot]:
        return [plot for name in names for plot in signal_plots(dataset, name)]

    return {
        "Attitude": [*pointing_plots(dataset), *attitude_plots(dataset)],
        "Rates": of("omega", "relative_rate", "rate_error"),
        "Torque": [
            *torque_plots(dataset),
            *share_plots(dataset),
            *of("constraint_torque", "disturbance"),
        ],
        "Control law": of("lyapunov", "mode"),
        "Actuators and sensors": of(*further_signals(dataset)),
    }


def extremes(dataset: Dataset) -> Table:
    """Return the least, largest and last value of every signal."""
    rows = []
    for name, variable in dataset.data_vars.items():
        if variable.dims[:1] != ("time",):
            continue
        values = variable.values.reshape(dataset.sizes["time"], -1)
        for part, column in zip(part_labels(dataset, str(name)), values.T, strict=True):
            good = column[np.isfinite(column)]
            if len(good):
                unit = str(variable.attrs.get("units", "1"))
                numbers = (float(good.min()), float(good.max()), float(good[-1]))
                label = part if part.startswith(str(name)) else f"{name} {part}".strip()
                rows.append([label, shown_unit(unit), *numbers])
    note = "At the saved times, not decimated."
    return Table("Numbers", ["signal", "unit", "least", "largest", "at the end"], rows, note)
