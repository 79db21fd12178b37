"""Section of a study: settled fraction, settling times, sensitivities, and worst cases."""

import dataclasses
import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from jaxsat.core.declaration.units import shown_unit
from jaxsat.report.document import Charts, Document, Facts, Listing, Table
from jaxsat.report.facts import scenario_facts
from jaxsat.report.page.plots import chart_of
from jaxsat.report.study_document import study_document
from jaxsat.report.study_plots import settling_over, settling_plots, success_over
from jaxsat.scenario import Scenario, dump
from jaxsat.simulation.engine.adaptive import Tolerance
from jaxsat.store.files import OutputError
from jaxsat.store.ledger import study_columns
from jaxsat.store.tables import case_table, open_study
from jaxsat.studies.sensitivities import Sensitivity, numbers_of
from jaxsat.studies.summary import Summary, summarise

WORST = 25
"""Number of rows in the table of worst cases."""

QUANTITIES = 6
"""Largest number of dispersed quantities over which success is drawn, the most important ones."""

FEWEST_QUANTITIES = 2
"""Least number of quantities that are drawn, even if none is significant."""

FILE = "study.toml"


def study_section(path: Path) -> Document:
    """Return the section of a store; raises `OutputError` for one that is empty or damaged."""
    study, columns = open_study(path), study_columns(path)
    identity, runs = (json.loads(study.attrs[name]) for name in ("identity", "runs"))
    try:
        summary = summarise(columns, worst=WORST)
    except ValueError:
        raise OutputError(f"{path} has no finished case.") from None
    finished_cases = np.flatnonzero(np.asarray(columns["status"]) == 1)
    times = np.asarray(columns["settling_time"])[finished_cases]
    tables = identity.get("scenario", {})
    scenario = {name: _without_absent(table) for name, table in tables.items() if table}
    document = study_document(summary, scenario)
    text = scenario_text(tables, path.stem)
    blocks: list[Any] = [
        Facts("Scenario", scenario_facts(scenario)),
        Charts("Settling", list(map(chart_of, settling_plots(times)))),
        *_quantities(columns, finished_cases, times, summary),
        *document.blocks,
        _worst(study, summary, identity, text is not None),
        _provenance(identity, runs, path),
    ]
    if text is not None:
        blocks.append(Listing("Scenario file", text, FILE))
    return dataclasses.replace(document, blocks=blocks, kind=f"Study in {path.name}")


def scenario_text(tables: Mapping[str, Any], title: str) -> str | None:
    """Return the scenario of a study as a file; None where its law is not installed."""
    present = {name: table for name, table in tables.items() if table is not None}
    try:
        return dump(Scenario.model_validate({"title": title, **present}))
    except ValidationError:
        return None


def _without_absent(value: Any) -> Any:
    if isinstance(value, Mapping):
        present = {key: _without_absent(entry) for key, entry in value.items() if entry is not None}
        return {key: entry for key, entry in present.items() if entry != {}}
    return [_without_absent(entry) for entry in value] if isinstance(value, list) else value


def _quantities(
    columns: Mapping[str, Any], finished_cases: np.ndarray, times: np.ndarray, summary: Summary
) -> list[Charts]:
    """Plot success and settling time over the most important dispersed numbers."""
    settled = np.isfinite(times)
    plots = []
    for label in _ranking(summary)[:QUANTITIES]:
        name = label.partition("[")[0]
        column = columns[f"drawn_{name}"]
        values = numbers_of(name, np.asarray(column)[finished_cases])[label]
        unit = "rad" if label == "attitude[angle]" else shown_unit(column.column.units) or "1"
        if 0 < settled.mean() < 1:
            plots.append(success_over(label, values, settled, unit))
        plots.append(settling_over(label, values, times, unit))
    charts = [chart_of(plot) for plot in plots if plot is not None]
    return [Charts("Over dispersed quantities", charts)] if charts else []


def _ranking(summary: Summary) -> list[str]:
    """Return the dispersed numbers on which settling depends, or the cost, by importance."""

    def weight(entry: Sensitivity) -> float:
        return -np.nan_to_num(entry.first_order.value, nan=-1.0)

    entries = sorted(summary.settling_sensitivity, key=lambda one: (not one.matters, weight(one)))
    if not any(one.matters for one in entries):
        entries = sorted(summary.cost_sensitivity, key=lambda one: (not one.matters, weight(one)))
    names = [one.name for one in entries]
    return names[: max(FEWEST_QUANTITIES, sum(one.matters for one in entries))]


def _worst(study: Any, summary: Summary, identity: Mapping[str, Any], has_file: bool) -> Table:
    """Return the worst cases with their draws, and the command that computes the first again."""
    table = case_table(study.isel(case=summary.worst))
    draw_names = [name for name in table if str(name).startswith("drawn_")]
    others = [name for name in table if str(name) not in draw_names]
    result_names = [
        name for name in others if not str(name).startswith(("quaternion", "w1", "w2", "z_"))
    ]
    result_names.sort(key=lambda name: name not in ("outcome", "settling_time_s"))
    columns = ["case", *map(str, result_names), *map(str, draw_names)]
    rows = []
    for case, row in table.iterrows():
        values = [row[name] for name in (*result_names, *draw_names)]
        cells = [value if isinstance(value, str) else _cell(value) for value in values]
        rows.append([int(str(case)), *cells])
    note = "Failed cases first, then unsettled cases, then the slowest."
    if not has_file:
        return Table("Worst cases", columns, rows, note)
    command = case_command(identity, summary.worst[0], summary.cases)
    note += (
        f" To compute a case again with its whole trajectory, save the scenario below as {FILE} "
        f"and run `{command}` with the number of the case."
    )
    return Table("Worst cases", columns, rows, note)


def _cell(value: Any) -> float | None:
    number = float(value)
    return None if np.isnan(number) else number


def case_command(identity: Mapping[str, Any], case: int, count: int) -> str:
    """Return the command that computes one case of a study, from the scenario file of the page."""
    engine = identity["engine"]
    words = ["jaxsat", "montecarlo", FILE, "--seed", str(identity["seed"])]
    words += ["--count", str(identity["size"] or count), "--engine", str(engine["name"])]
    if "batch_size" in engine:
        words += ["--batch-size", str(engine["batch_size"])]
    return shlex.join([*words, "--case", str(case)])


def _engine(identity: Mapping[str, Any]) -> Iterator[str]:
    for key, value in identity.items():
        if key == "tolerance":
            names = [one.name for one in dataclasses.fields(Tolerance)]
            yield from (f"{name} {one:g}" for name, one in zip(names, value, strict=True))
        else:
            yield f"{key} {value}"


def _provenance(identity: Mapping[str, Any], runs: list[dict[str, Any]], path: Path) -> Facts:
    text = json.dumps(identity["scenario"], sort_keys=True)
    rows = {
        "store": str(path.name),
        "scenario (SHA-256)": hashlib.sha256(text.encode()).hexdigest(),
        "program": str(identity.get("program", {}).get("operations", "")),
        "seed": str(identity["seed"]),
        "sampling": str(identity["design"]).lower(),
        "engine": ", ".join(_engine(identity["engine"])),
    }
    for place, run in enumerate(runs, 1):
        versions = ", ".join(f"{name} {version}" for name, version in run["versions"].items())
        machine = run.get("machine", {}).get("processor", "")
        rows[f"run {place}"] = (
            f"{run.get('created', '')}: {versions}; {run.get('platform', '')}, {machine}"
        )
    return Facts("Provenance", {label: value for label, value in rows.items() if value})
