"""The section of a designed controller, from the files of its folder."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.core.numerals import number_text
from jaxsat.report.page.batches import LAW_COLUMNS, LAWS_NOTE
from jaxsat.report.page.content import (
    Block,
    Chart,
    Charts,
    Facts,
    Lines,
    Listing,
    Section,
    Table,
    Verdict,
)
from jaxsat.report.page.reading import form_explained, read_lines, read_record, record_provenance
from jaxsat.report.page.run import scenario_facts
from jaxsat.report.page.study_charts import (
    convergence_chart,
    settled_by_chart,
    settling_times_chart,
)
from jaxsat.store import study_columns
from jaxsat.store.design_text import (
    ASSUMPTIONS,
    DESIGNED,
    IN_COMMON,
    LAWS_NOT_FITTING,
    REMEDIES,
    REMEDIES_NOTE,
    UNSETTLED_CASES,
    tuning_text,
)

MOST_CASES = 25
"""Failing cases that are listed."""

STEPS = ("screening", "validation")


def design_section(folder: Path) -> Section:
    """Whether a controller was found, what it was verified on, and what would help."""
    record = read_record(folder / "design.json")
    scenario = read_lines(folder / DESIGNED)
    with form_explained(folder):
        tables = tomllib.loads(scenario)
        blocks = list(_blocks(folder, record, tables))
        verdict = _verdict(record)
        facts = record_provenance(record, seeds=_seeds(record["seeds"]))
    blocks.append(facts)
    if scenario:
        blocks.append(Listing("Designed scenario", scenario, DESIGNED))
    title = str(tables.get("title", folder.name))
    return Section(f"Design: {title}", f"Design in {folder.name}", verdict, blocks)


def _verdict(record: Mapping[str, Any]) -> Verdict:
    more = list(record["controllability"]["lines"])
    found = record["verification"]
    if found is not None:
        times = found["settling_time_s"].items()
        parts = [
            f"{percent} %: {number_text(one['value'])} s" for percent, one in times if one["value"]
        ]
        if parts:
            more.insert(0, f"Settling time of those that settle: {', '.join(parts)}.")
    return Verdict(record["outcome"] == "reached", record["headline"], more)


def _seeds(seeds: Mapping[str, Any]) -> str:
    return ", ".join(f"{step} {seed}" for step, seed in seeds.items())


def _blocks(folder: Path, record: Mapping[str, Any], tables: Mapping[str, Any]) -> Iterator[Block]:
    if tables:
        yield Facts("Designed scenario", scenario_facts(tables))
    if record["gains"]:
        rows = [[name, *_gain(value)] for name, value in record["gains"].items()]
        yield Table("Gains", ["gain", "value"], rows)
    charts = list(_charts(folder, record))
    if charts:
        yield Charts("Verification on unseen cases", charts)
    yield from _failing(record)
    rows = [
        [step, *(read(row) for read in LAW_COLUMNS.values())]
        for step in STEPS
        if record[step]
        for row in record[step]["rows"]
    ]
    if rows:
        yield Table("Laws in screening and validation", ["step", *LAW_COLUMNS], rows, LAWS_NOTE)
    taken = [f"{step.capitalize()}: {record[step]['reason']}." for step in STEPS if record[step]]
    lines = {
        "Why this law": [*taken, *([tuning_text(record["tuning"])] if record["tuning"] else [])],
        ASSUMPTIONS: record["assumed"],
        LAWS_NOT_FITTING: record["left_out"],
    }
    for title, told in lines.items():
        if told:
            yield Lines(title, told)


def _gain(value: Any) -> list[Any]:
    """A number as a number, a vector as text."""
    if isinstance(value, (list, tuple)):
        return [", ".join(number_text(one) for one in value)]
    return [value]


def _charts(folder: Path, record: Mapping[str, Any]) -> Iterator[Chart]:
    """Settling of the cases of the verification, from its store if that is there."""
    name = re.sub(r"[^\w.-]+", "-", f"verification-{record['chosen']}")
    store = folder / "studies" / f"{name}.zarr"
    if record["verification"] is None or not (store / "zarr.json").is_file():
        return
    times = np.asarray(study_columns(store)["settling_time"])[: record["verification"]["cases"]]
    for chart in (settled_by_chart(times), settling_times_chart(times), convergence_chart(times)):
        if chart is not None:
            yield chart


def _failing(record: Mapping[str, Any]) -> Iterator[Block]:
    """The cases that do not settle, what they have in common, and what would help."""
    found = record["verification"]
    if found is None or not found["failing_cases"]:
        return
    seed = record["seeds"]["verification"]
    rows = [
        [case, f"jaxsat montecarlo {DESIGNED} --seed {seed} --case {case}"]
        for case in found["failing_cases"][:MOST_CASES]
    ]
    left = len(found["failing_cases"]) - len(rows)
    note = "The command computes the case again with its whole trajectory."
    note += f" {left} more are in design.json." if left else ""
    yield Table(UNSETTLED_CASES, ["case", "command"], rows, note, frozenset({"command"}))
    if found["separations"]:
        columns = ["number", "share explained"]
        columns += [
            f"{which}, {part} %" for which in ("failing", "settled") for part in (10, 50, 90)
        ]
        rows = [
            [one["name"], one["share"], *one["failing"], *one["settled"]]
            for one in found["separations"]
        ]
        yield Table(IN_COMMON, columns, rows)
    if found["remedies"]:
        rows = [[one["change"], one["settled"], one["flown"]] for one in found["remedies"]]
        yield Table(REMEDIES, ["change", "settle then", "of"], rows, REMEDIES_NOTE)
