"""Sections of a page from folders of tunings, comparisons, designs, analyses and reproductions.

A file that is unreadable or was changed raises one error.
"""

import contextlib
import csv
import dataclasses
import io
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.report.comparison_document import comparison_document, place_of
from jaxsat.report.controllability_document import controllability_document
from jaxsat.report.design_document import DESIGNED, design_document
from jaxsat.report.document import Block, Chart, Charts, Document, Facts, Listing, Table
from jaxsat.report.facts import (
    provenance_facts,
    record_provenance,
    scenario_facts,
    scenario_tables,
    spacecraft_facts,
)
from jaxsat.report.page.plots import chart_of
from jaxsat.report.plot import Axis
from jaxsat.report.rare_event_document import rare_event_document, rare_event_plots
from jaxsat.report.reproduction import RUNS, claims_document, judge
from jaxsat.report.study_plots import curves, settled_by_law, settling_plots
from jaxsat.report.style import MOST_LINES
from jaxsat.report.tuning_document import gain_plots, loss_plots, tuning_document
from jaxsat.report.verification_document import verification_document
from jaxsat.report.worst_case_document import worst_case_document
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.files import OutputError, parse_json
from jaxsat.store.labels import named_store, store_of_row
from jaxsat.store.ledger import study_columns
from jaxsat.store.marker import read_unchanged


def read_record(path: Path) -> Mapping[str, Any]:
    """Return the JSON object of a file; raises `OutputError`."""
    record = parse_json(read_unchanged(path))
    if not isinstance(record, Mapping):
        raise OutputError(f"{path} is damaged, or was not written by jaxsat.")
    return record


def read_lines(path: Path) -> str:
    """Return the text of a file, empty for a missing one; raises `OutputError`."""
    return (read_unchanged(path) or b"").decode(errors="replace")


@contextlib.contextmanager
def form_explained(folder: Path) -> Iterator[None]:
    """Turn errors by missing numbers into an `OutputError` that names the folder."""
    try:
        yield
    except (KeyError, IndexError, TypeError, AttributeError, ValueError) as error:
        raise OutputError(f"{folder} contains numbers of another form; write it again.") from error


def _section(kind: str, folder: Path, document: Document, *blocks: Block) -> Document:
    """Return the section of a folder: its document, then further blocks."""
    blocks = (*document.blocks, *blocks)
    return dataclasses.replace(document, blocks=blocks, kind=f"{kind} in {folder.name}")


def tuning_section(folder: Path) -> Document:
    """Return the section of a tuning."""
    verdict, receipt = (read_record(folder / f"{name}.json") for name in ("verdict", "receipt"))
    history = open_trajectory(folder / "history.nc")
    baselines = parse_json(read_unchanged(folder / "baselines.json")) or ()
    title = str(history.attrs.get("title", "")) or folder.name
    with form_explained(folder):
        document = tuning_document(title, verdict, receipt, baselines)
    return _section(
        "Tuning",
        folder,
        document,
        Charts("On the way", [*map(chart_of, [*loss_plots(history), *gain_plots(history)])]),
        Facts("Scenario before", scenario_facts(scenario_tables(history))),
        provenance_facts(history.attrs),
        Listing("Tuned scenario", read_lines(folder / "tuned.toml"), "tuned.toml"),
    )


def record_section(folder: Path) -> Document:
    """Return the section of a folder whose document comes from its record alone."""
    name, kind, document_of, charts_of = next(
        one for one in OF_RECORDS if (folder / one[0]).is_file()
    )
    record = read_record(folder / name)
    with form_explained(folder):
        document, charts = document_of(record), charts_of(folder, record)
    return _section(kind, folder, document, *charts, record_provenance(record))


def _levels(folder: Path, record: Mapping[str, Any]) -> list[Block]:
    return [Charts("Levels and violations", list(map(chart_of, rare_event_plots(record))))]


def _settled_by_law(folder: Path, record: Mapping[str, Any]) -> list[Block]:
    times: dict[str, dict[str, np.ndarray]] = {}
    for row in record["rows"]:
        store = store_of_row(folder, row)
        if (store / "zarr.json").is_file():
            settling = np.asarray(study_columns(store)["settling_time"])
            times.setdefault(place_of(row), {})[row["law"]] = settling
    title = "{}: fraction settled by a time"
    charts = [chart_of(settled_by_law(title.format(where), of)) for where, of in times.items()]
    return [Charts("Settling", charts)]


OF_RECORDS = (
    ("comparison.json", "Comparison", comparison_document, _settled_by_law),
    ("verification.json", "Verification", verification_document, lambda *_: []),
    ("rare-event.json", "Rare event", rare_event_document, _levels),
    ("worst-case.json", "Worst case", worst_case_document, lambda *_: []),
)
"""File, kind, document and charts of the results whose document comes from their record alone."""


def reproduction_section(folder: Path) -> Document:
    """Return the section of the paper's claims, judged from the trajectories in the folder."""
    datasets = {name: open_trajectory(folder / f"{name}.nc") for name in RUNS}
    document = claims_document(judge(datasets))
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
    files = Table("Files", ["run", "purpose", "outcome"], runs)
    provenance = provenance_facts(next(iter(datasets.values())).attrs)
    return _section("Reproduction", folder, document, Charts("Runs", charts), files, provenance)


def controllability_section(folder: Path) -> Document:
    """Return the section of an analysis of controllability."""
    dataset = open_trajectory(folder / "failures.nc")
    title = str(dataset.attrs.get("title", "")) or folder.name
    with form_explained(folder):
        records = list(csv.DictReader(io.StringIO(read_lines(folder / "failures.csv"))))
        verdict, findings = (str(dataset.attrs[name]) for name in ("verdict", "findings"))
        document = controllability_document(title, verdict, records, findings.splitlines())
    blocks = [
        Facts("Spacecraft", spacecraft_facts(scenario_tables(dataset))),
        *document.blocks,
        provenance_facts(dataset.attrs),
        Listing("Scenario file", str(dataset.attrs.get("scenario", "")), "scenario.toml"),
    ]
    return dataclasses.replace(document, blocks=blocks, kind=f"Controllability in {folder.name}")


def design_section(folder: Path) -> Document:
    """Return the section of a design."""
    record = read_record(folder / "design.json")
    scenario = read_lines(folder / DESIGNED)
    blocks: list[Block] = []
    with form_explained(folder):
        document = design_document(record)
        if tables := tomllib.loads(scenario):
            blocks.append(Facts("Designed scenario", scenario_facts(tables)))
        if charts := list(_charts(folder, record)):
            blocks.append(Charts("Verification on unseen cases", charts))
        seeds = ", ".join(f"{step} {seed}" for step, seed in record["seeds"].items())
        blocks += [*document.blocks, record_provenance(record, seeds=seeds)]
    if scenario:
        blocks.append(Listing("Designed scenario", scenario, DESIGNED))
    return dataclasses.replace(document, blocks=blocks, kind=f"Design in {folder.name}")


def _charts(folder: Path, record: Mapping[str, Any]) -> Iterator[Chart]:
    store = named_store(folder, f"verification-{record['chosen']}")
    if record["verification"] is None or not (store / "zarr.json").is_file():
        return
    times = np.asarray(study_columns(store)["settling_time"])[: record["verification"]["cases"]]
    yield from map(chart_of, settling_plots(times))
