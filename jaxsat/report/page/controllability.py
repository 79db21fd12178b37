"""The section of an analysis of controllability, from the files of its folder."""

import csv
import dataclasses
import io
from pathlib import Path

from jaxsat.report.controllability_document import controllability_document
from jaxsat.report.document import Document, Facts, Listing
from jaxsat.report.facts import provenance_facts, scenario_facts, scenario_tables
from jaxsat.report.page.reading import form_explained, read_lines
from jaxsat.store import open_trajectory


def controllability_section(folder: Path) -> Document:
    """Whether the spacecraft can be steered, now and after every failure."""
    dataset = open_trajectory(folder / "failures.nc")
    title = str(dataset.attrs.get("title", "")) or folder.name
    with form_explained(folder):
        records = list(csv.DictReader(io.StringIO(read_lines(folder / "failures.csv"))))
        verdict, findings = (str(dataset.attrs[name]) for name in ("verdict", "findings"))
        told = controllability_document(title, verdict, records, findings.splitlines())
    blocks = [
        Facts("Scenario", scenario_facts(scenario_tables(dataset))),
        *told.blocks,
        provenance_facts(dataset.attrs),
        Listing("Scenario file", str(dataset.attrs.get("scenario", "")), "scenario.toml"),
    ]
    return dataclasses.replace(told, blocks=blocks, kind=f"Controllability in {folder.name}")
