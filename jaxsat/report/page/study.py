"""The section of a study: how many cases settle, when, sensitivities, and the worst."""

import dataclasses
import hashlib
import json
import shlex
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from jaxsat.core.numerals import number_text
from jaxsat.report.page.content import Charts, Facts, Listing, Section, Table, Verdict
from jaxsat.report.page.recovery import recovery_line, recovery_tables
from jaxsat.report.page.run import scenario_facts, settled_meaning
from jaxsat.report.page.study_charts import (
    convergence_chart,
    settled_by_chart,
    settling_over_chart,
    settling_times_chart,
    success_chart,
)
from jaxsat.scenario import Scenario, dump
from jaxsat.simulation.engine.adaptive import Tolerance
from jaxsat.store import OutputError, case_table, open_study, study_columns
from jaxsat.studies import (
    Sensitivity,
    Summary,
    ends_text,
    numbers_of,
    percent_texts,
    summarise,
)

WORST = 25
"""Cases of the table of the worst."""

QUANTITIES = 6
"""Dispersed quantities over which success is drawn, those that matter most."""

FEWEST_QUANTITIES = 2
"""Drawn even where none of them can be told from chance."""

FILE = "study.toml"


def study_section(path: Path) -> Section:
    """What a store has to say; raises `OutputError` for one that is empty or damaged."""
    study, columns = open_study(path), study_columns(path)
    identity, runs = (json.loads(study.attrs[name]) for name in ("identity", "runs"))
    try:
        summary = summarise(columns, worst=WORST)
    except ValueError:
        raise OutputError(f"{path} has no finished case.") from None
    done = np.flatnonzero(np.asarray(columns["status"]) == 1)
    times = np.asarray(columns["settling_time"])[done]
    scenario = {name: _told(table) for name, table in identity["scenario"].items() if table}
    text = scenario_text(identity["scenario"], path.stem)
    charts = [settled_by_chart(times), settling_times_chart(times), convergence_chart(times)]
    blocks: list[Any] = [
        Facts("Scenario", scenario_facts(scenario)),
        *recovery_tables(summary.recovery),
        Charts("Settling", [chart for chart in charts if chart is not None]),
        *_quantities(columns, done, times, summary),
        _percentiles(summary),
        *_rankings(summary),
        _worst(study, summary, identity, text is not None),
        _provenance(identity, runs, path),
    ]
    if text is not None:
        blocks.append(Listing("Scenario file", text, FILE))
    law = identity["scenario"].get("control", {}).get("law", "unknown")
    title = f"{summary.cases:,} cases under the law {law}"
    verdict = study_verdict(summary, settled_meaning(scenario, of_study=True))
    return Section(title, f"Study in {path.name}", verdict, blocks)


def study_verdict(summary: Summary, settled: str) -> Verdict:
    """The settled fraction with its interval, what `settled` means, settling times, and how the
    others ended."""
    fraction, low, high = percent_texts(summary.settled)
    interval = f"95 % interval {low} to {high}"
    text = f"{fraction} of {summary.cases:,} cases settle ({interval})."
    more = [f"Settled means {settled}."]
    more += [
        "Outcomes: " + ", ".join(f"{n:,} {name}" for name, n in summary.outcomes.items()) + "."
    ]
    if summary.settling_time:
        parts = [
            f"{percent:g} %: {number_text(t.value)} s"
            for percent, t in summary.settling_time.items()
        ]
        more.append(f"Settling time of those that settle: {', '.join(parts)}.")
    if summary.recovery is not None:
        more.append(recovery_line(summary.recovery))
    return Verdict(None, text, more)


def scenario_text(tables: Mapping[str, Any], title: str) -> str | None:
    """The scenario of a study as a file; None where its law is not installed here."""
    given = {name: table for name, table in tables.items() if table is not None}
    try:
        return dump(Scenario.model_validate({"title": title, **given}))
    except ValidationError:
        return None


def _told(value: Any) -> Any:
    """A table without what is not given."""
    if isinstance(value, Mapping):
        told = {key: _told(entry) for key, entry in value.items() if entry is not None}
        return {key: entry for key, entry in told.items() if entry != {}}
    return [_told(entry) for entry in value] if isinstance(value, list) else value


def _quantities(
    columns: Mapping[str, Any], done: np.ndarray, times: np.ndarray, summary: Summary
) -> list[Charts]:
    """Success and settling time over the dispersed numbers that matter most."""
    settled = np.isfinite(times)
    charts = []
    for label in _ranked(summary)[:QUANTITIES]:
        name = label.partition("[")[0]
        column = columns[f"drawn_{name}"]
        values = numbers_of(name, np.asarray(column)[done])[label]
        unit = "rad" if label == "attitude[angle]" else column.column.units
        if 0 < settled.mean() < 1:
            charts.append(success_chart(label, values, settled, unit))
        charts.append(settling_over_chart(label, values, times, unit))
    shown = [chart for chart in charts if chart is not None]
    return [Charts("Over dispersed quantities", shown)] if shown else []


def _ranked(summary: Summary) -> list[str]:
    """The dispersed numbers on which settling depends, or the cost, by how much they matter."""

    def weight(entry: Sensitivity) -> float:
        return -np.nan_to_num(entry.first_order.value, nan=-1.0)

    entries = sorted(summary.settling_sensitivity, key=lambda one: (not one.matters, weight(one)))
    if not any(one.matters for one in entries):
        entries = sorted(summary.cost_sensitivity, key=lambda one: (not one.matters, weight(one)))
    names = [one.name for one in entries]
    return names[: max(FEWEST_QUANTITIES, sum(one.matters for one in entries))]


def _percentiles(summary: Summary) -> Table:
    rows = []
    for name, unit in {"settling_time": "s", "effort": "N m s"}.items():
        for percent, found in getattr(summary, name).items():
            rows.append(
                [f"{name.replace('_', ' ')} ({unit})", percent, found.value, ends_text(found)]
            )
    return Table("Percentiles", ["quantity", "percentile", "value", "95 % interval"], rows)


def _rankings(summary: Summary) -> list[Table]:
    """Sensitivities of settling and cost."""
    rankings = {"settling": summary.settling_sensitivity, "the cost": summary.cost_sensitivity}
    columns = [
        *("quantity", "first-order index", "interval of the index"),
        *("rank correlation", "interval of the correlation", "significant"),
    ]
    note = "The 95 % intervals hold simultaneously."
    found = []
    for name, ranking in rankings.items():
        rows = [
            [
                one.name,
                one.first_order.value,
                ends_text(one.first_order, partial(number_text, digits=3)),
                one.rank_correlation.value,
                ends_text(one.rank_correlation, partial(number_text, digits=3)),
                "yes" if one.matters else "no",
            ]
            for one in ranking
            if np.isfinite(one.first_order.value)
        ]
        if rows:
            title = f"Sensitivity of {name}"
            found.append(Table(title, columns, rows, note))
    return found


def _worst(study: Any, summary: Summary, identity: Mapping[str, Any], known: bool) -> Table:
    """The worst cases with what was drawn, and the command that computes the first again."""
    table = case_table(study.isel(case=summary.worst))
    drawn = [name for name in table if str(name).startswith("drawn_")]
    told = [name for name in table if str(name) not in drawn]
    shown = [name for name in told if not str(name).startswith(("quaternion", "w1", "w2", "z_"))]
    shown.sort(key=lambda name: name not in ("outcome", "settling_time_s"))
    columns = ["case", *map(str, shown), *map(str, drawn)]
    rows = []
    for case, row in table.iterrows():
        values = [row[name] for name in (*shown, *drawn)]
        cells = [value if isinstance(value, str) else _cell(value) for value in values]
        rows.append([int(str(case)), *cells])
    note = "Failed cases first, then unsettled cases, then the slowest."
    if not known:
        return Table("Worst cases", columns, rows, note)
    note += (
        f" To compute a case again with its whole trajectory, save the scenario below as {FILE} "
        "and run this command with the number of the case:"
    )
    command = case_command(identity, summary.worst[0], summary.cases)
    return Table("Worst cases", columns, rows, note, command=command)


def _cell(value: Any) -> float | None:
    found = float(value)
    return None if np.isnan(found) else found


def case_command(identity: Mapping[str, Any], case: int, count: int) -> str:
    """The command that computes one case of a study again, from the scenario file of the page."""
    engine = identity["engine"]
    words = ["jaxsat", "montecarlo", FILE, "--seed", str(identity["seed"])]
    words += ["--count", str(identity["size"] or count), "--engine", str(engine["name"])]
    if "batch_size" in engine:
        words += ["--batch-size", str(engine["batch_size"])]
    return shlex.join([*words, "--case", str(case)])


def _engine(identity: Mapping[str, Any]) -> Iterator[str]:
    """What says how an engine integrates, every number with its name."""
    for key, value in identity.items():
        if key == "tolerance":
            names = [one.name for one in dataclasses.fields(Tolerance)]
            yield from (f"{name} {one:g}" for name, one in zip(names, value, strict=True))
        else:
            yield f"{key} {value}"


def _provenance(identity: Mapping[str, Any], runs: list[dict[str, Any]], path: Path) -> Facts:
    """What made a store: program, seed, versions and machines of every time it was continued."""
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
