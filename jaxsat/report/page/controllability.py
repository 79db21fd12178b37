"""The section of an analysis of controllability, from the files of its folder."""

import csv
import io
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from jaxsat.report.document import Cell, Document, Facts, Lines, Listing, Table, Verdict
from jaxsat.report.facts import provenance_facts, scenario_facts, scenario_tables
from jaxsat.report.page.reading import form_explained, read_lines
from jaxsat.store import open_trajectory

GOOD = {"controllable": True, "uncontrollable": False}

COLUMNS = {
    "failed": "failed",
    "verdict": "verdict",
    "laws": "applicable laws",
    "rank": "rank",
    "margin": "margin",
    "turn_time_s": "turn at 1 N m (s)",
    "torques": "attainable torques",
    "lost": "lost",
}
"""What is told of a failure, by its name in failures.csv."""


def controllability_section(folder: Path) -> Document:
    """Whether the spacecraft can be steered, now and after every failure."""
    dataset = open_trajectory(folder / "failures.nc")
    page = read_lines(folder / "controllability.md").partition("\n## ")[0]
    findings = [line[2:].replace("**", "") for line in page.splitlines() if line.startswith("- ")]
    with form_explained(folder):
        rows = list(csv.DictReader(io.StringIO(read_lines(folder / "failures.csv"))))
        cells = [[_cell(name, row) for name in COLUMNS] for row in rows]
        now = str(rows[0]["verdict"])
        single = Counter(row["verdict"] for row in rows[1:] if " " not in row["failed"])
    told = ", ".join(f"{count} {verdict}" for verdict, count in single.items())
    number = single.total()
    verdict = Verdict(
        GOOD.get(now),
        str(dataset.attrs.get("verdict", now)),
        [f"Of {number} single failures {told}."] if single else [],
    )
    text = str(dataset.attrs.get("scenario", ""))
    blocks = [
        Facts("Scenario", scenario_facts(scenario_tables(dataset))),
        Table(
            "Every failure",
            list(COLUMNS.values()),
            cells,
            "The margin compares directions. The turn time is the time to turn by one radian about "
            "the axis that is hardest to reach.",
        ),
        Lines("Findings", findings[1:]),
        provenance_facts(dataset.attrs),
        Listing("Scenario file", text, "scenario.toml"),
    ]
    title = str(dataset.attrs.get("title", "")) or folder.name
    return Document(title, verdict, blocks, f"Controllability in {folder.name}")


def _cell(name: str, row: Mapping[str, str]) -> Cell:
    if name == "rank":
        return f"{row[name]} of {row['dimension']}"
    return float(row[name]) if name in ("margin", "turn_time_s") else row[name]
