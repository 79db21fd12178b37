"""The sections of a tuning, a comparison and a reproduction, from the files of their folders."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.report.comparison_document import comparison_document, place_of
from jaxsat.report.document import (
    Chart,
    Charts,
    Document,
    Facts,
    Listing,
    Table,
)
from jaxsat.report.facts import (
    provenance_facts,
    record_provenance,
    scenario_facts,
    scenario_tables,
)
from jaxsat.report.page.plots import chart_of
from jaxsat.report.page.reading import form_explained, read_lines, read_record
from jaxsat.report.plot import Axis
from jaxsat.report.reproduction import RUNS, claims_document, judge
from jaxsat.report.study_plots import curves, settled_by_law
from jaxsat.report.style import MOST_LINES
from jaxsat.report.tuning_document import tuning_document
from jaxsat.report.tuning_plots import gain_plots, loss_plots
from jaxsat.store import open_trajectory, study_columns
from jaxsat.store.files import parse_json
from jaxsat.store.marker import read_unchanged
from jaxsat.store.study_names import store_of_row


def tuning_section(folder: Path) -> Document:
    """What a tuning found: whether the gains are better, and whether to trust it."""
    verdict, receipt = (read_record(folder / f"{name}.json") for name in ("verdict", "receipt"))
    history = open_trajectory(folder / "history.nc")
    baselines = parse_json(read_unchanged(folder / "baselines.json")) or ()
    title = str(history.attrs.get("title", "")) or folder.name
    with form_explained(folder):
        told = tuning_document(title, verdict, receipt, baselines)
    tuned = read_lines(folder / "tuned.toml")
    blocks = [
        *told.blocks,
        Charts("On the way", [*map(chart_of, [*loss_plots(history), *gain_plots(history)])]),
        Facts("Scenario before", scenario_facts(scenario_tables(history))),
        provenance_facts(history.attrs),
        Listing("Tuned scenario", tuned, "tuned.toml"),
    ]
    return dataclasses.replace(told, blocks=blocks, kind=f"Tuning in {folder.name}")


def comparison_section(folder: Path) -> Document:
    """Which law to take, and how all of them did on the same cases."""
    record = read_record(folder / "comparison.json")
    with form_explained(folder):
        told = comparison_document(record)
    blocks = [
        *told.blocks,
        Charts("Settling", _settled_by_law(folder, record["rows"])),
        record_provenance(record),
    ]
    return dataclasses.replace(told, blocks=blocks, kind=f"Comparison in {folder.name}")


def _settled_by_law(folder: Path, rows: list[Mapping[str, Any]]) -> list[Chart]:
    """The fraction settled by a time, a line for each law, from the stores that are there."""
    times: dict[str, dict[str, np.ndarray]] = {}
    for row in rows:
        store = store_of_row(folder, row)
        if (store / "zarr.json").is_file():
            settling = np.asarray(study_columns(store)["settling_time"])
            times.setdefault(place_of(row), {})[row["law"]] = settling
    title = "{}: fraction settled by a time"
    return [chart_of(settled_by_law(title.format(where), of)) for where, of in times.items()]


def reproduction_section(folder: Path) -> Document:
    """The paper's claims, judged again from the trajectories in the folder."""
    datasets = {name: open_trajectory(folder / f"{name}.nc") for name in RUNS}
    told = claims_document(judge(datasets))
    charts, names_of = [], list(datasets)
    for first in range(0, len(names_of), MOST_LINES):
        names = names_of[first : first + MOST_LINES]
        sizes = {
            name: (
                datasets[name]["time"].values,
                np.linalg.norm(datasets[name]["omega"].values, axis=1),
            )
            for name in names
        }
        title, size = "Size of the angular velocity", Axis("|ω|", "rad/s")
        charts.append(chart_of(curves(title, sizes, Axis("time", "s"), size)))
    runs = [
        [f"{name}.nc", RUNS[name].purpose, str(data.attrs["outcome"])]
        for name, data in datasets.items()
    ]
    blocks = [
        *told.blocks,
        Charts("Runs", charts),
        Table("Files", ["run", "purpose", "outcome"], runs),
        provenance_facts(next(iter(datasets.values())).attrs),
    ]
    return dataclasses.replace(told, blocks=blocks, kind=f"Reproduction in {folder.name}")
