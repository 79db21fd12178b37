"""The section of a designed controller, from the files of its folder."""

import dataclasses
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.report.design_document import DESIGNED, design_document
from jaxsat.report.document import Block, Chart, Charts, Document, Facts, Listing
from jaxsat.report.facts import record_provenance, scenario_facts
from jaxsat.report.page.plots import chart_of
from jaxsat.report.page.reading import form_explained, read_lines, read_record
from jaxsat.report.study_plots import settling_plots
from jaxsat.store import study_columns


def design_section(folder: Path) -> Document:
    """Whether a controller was found, what it was verified on, and what would help."""
    record = read_record(folder / "design.json")
    scenario = read_lines(folder / DESIGNED)
    blocks: list[Block] = []
    with form_explained(folder):
        told = design_document(record)
        if tables := tomllib.loads(scenario):
            blocks.append(Facts("Designed scenario", scenario_facts(tables)))
        if charts := list(_charts(folder, record)):
            blocks.append(Charts("Verification on unseen cases", charts))
        seeds = ", ".join(f"{step} {seed}" for step, seed in record["seeds"].items())
        blocks += [*told.blocks, record_provenance(record, seeds=seeds)]
    if scenario:
        blocks.append(Listing("Designed scenario", scenario, DESIGNED))
    return dataclasses.replace(told, blocks=blocks, kind=f"Design in {folder.name}")


def _charts(folder: Path, record: Mapping[str, Any]) -> Iterator[Chart]:
    """Settling of the cases of the verification, from its store if that is there."""
    name = re.sub(r"[^\w.-]+", "-", f"verification-{record['chosen']}")
    store = folder / "studies" / f"{name}.zarr"
    if record["verification"] is None or not (store / "zarr.json").is_file():
        return
    times = np.asarray(study_columns(store)["settling_time"])[: record["verification"]["cases"]]
    yield from map(chart_of, settling_plots(times))
