"""The sections of a tuning, a comparison and a reproduction, from the files of their folders."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jaxsat.core.numerals import number_text
from jaxsat.report.page.charts import MOST_LINES
from jaxsat.report.page.content import (
    Chart,
    Charts,
    Facts,
    Listing,
    Section,
    Table,
    Verdict,
)
from jaxsat.report.page.reading import form_explained, read_lines, read_record, record_provenance
from jaxsat.report.page.run import provenance_facts, scenario_facts, scenario_tables
from jaxsat.report.page.study_charts import curves_chart
from jaxsat.report.reproduction import RUNS, ClaimVerdict, judge
from jaxsat.store import open_trajectory, study_columns
from jaxsat.store.study_names import store_of_row

LAW_COLUMNS: Mapping[str, Callable[[Mapping[str, Any]], Any]] = {
    "law": lambda row: row["law"],
    "cases": lambda row: row["cases"],
    "settled": lambda row: row["settled"]["value"],
    "settled, low": lambda row: row["settled"]["low"],
    "settled, high": lambda row: row["settled"]["high"],
    "half by (s)": lambda row: row["t50"]["value"],
    "90 % by (s)": lambda row: row["t90"]["value"],
    "effort (N m s)": lambda row: row["effort_N_m_s"],
    "peak rate (rad/s)": lambda row: row["peak_rate_rad_s"],
}
"""What a row of a comparison says of its law, by heading."""

LAWS_NOTE = "Settled is a fraction with its 95 % Wilson interval; times are those of all cases."

EVALUATIONS = {
    "before": "held out, before",
    "after": "held out, after",
    "trained_before": "training seed, before",
    "trained_after": "training seed, after",
}


def tuning_section(folder: Path) -> Section:
    """What a tuning found: whether the gains are better, and whether to trust it."""
    verdict, receipt = (read_record(folder / f"{name}.json") for name in ("verdict", "receipt"))
    history = open_trajectory(folder / "history.nc")
    with form_explained(folder):
        tables = [_gains(verdict), _evaluations(verdict)]
        told = _tuning_verdict(verdict, receipt)
    tuned = read_lines(folder / "tuned.toml")
    title = str(history.attrs.get("title", "")) or folder.name
    blocks = [
        *tables,
        Charts("On the way", list(_tuning_charts(history))),
        Facts("Scenario before", scenario_facts(scenario_tables(history))),
        provenance_facts(history.attrs),
        Listing("Tuned scenario", tuned, "tuned.toml"),
    ]
    return Section(f"Tuning: {title}", f"Tuning in {folder.name}", told, blocks)


def _tuning_verdict(verdict: Mapping[str, Any], receipt: Mapping[str, Any]) -> Verdict:
    before, after = (verdict[name]["loss"] for name in ("before", "after"))
    better = after < before
    how = f"the objective on held-out cases goes from {number_text(before)} to {number_text(after)}"
    text = f"The tuned gains are better: {how}." if better else f"No better gains: {how}."
    more = [f"The gradient of this run is not trustworthy: {one}." for one in receipt["problems"]]
    more += [
        f"{name} is at its bound, {number_text(at)}." for name, at in verdict["at_bounds"].items()
    ]
    return Verdict(better and not receipt["problems"], text, more)


def _gains(verdict: Mapping[str, Any]) -> Table:
    rows = [[name, one["before"], one["after"]] for name, one in verdict["gains"].items()]
    return Table("Gains", ["gain", "before", "after"], rows)


def _evaluations(verdict: Mapping[str, Any]) -> Table:
    """Settling, effort and cost before and after."""
    found = [verdict[name] for name in EVALUATIONS]

    def value(entry: Mapping[str, Any] | None) -> float | None:
        return None if entry is None else entry["value"]

    rows: list[list[Any]] = [
        ["cases", *(one["cases"] for one in found)],
        ["settled, fraction", *(value(one["settled"]) for one in found)],
    ]
    for percent in ("50.0", "90.0"):
        times = [value(one["settling_time"].get(percent)) for one in found]
        rows.append([f"settling time of those, {percent.removesuffix('.0')} % (s)", *times])
    rows.append(["mean cost of those that end", *(value(one["cost"]) for one in found)])
    rows.append(["failed, fraction", *(value(one["failed"]) for one in found)])
    rows.append(["objective", *(one["loss"] for one in found)])
    return Table("Before and after", ["of", *EVALUATIONS.values()], rows)


def _tuning_charts(history: xr.Dataset) -> Iterator[Chart]:
    """Loss and gains over the steps."""
    steps, checks = history["step"].values, history["validation"].values
    best = history["loss"].min("start").values
    curves = {
        "training, best start": (steps, best),
        "validation, best so far": (checks, history["best_loss"].values),
    }
    yield curves_chart("Loss", curves, ("step", "loss"), log="y")
    units = np.atleast_1d(history.attrs.get("parameter_units", ""))
    for place, name in enumerate(map(str, history["parameter"].values)):
        value = history["best_gain"].values[:, place]
        unit = f" ({units[place]})" if place < len(units) and units[place] not in ("", "1") else ""
        yield curves_chart(
            f"{name}{unit}: best so far", {name: (checks, value)}, ("step", ""), steps=True
        )


def comparison_section(folder: Path) -> Section:
    """Which law to take, and how all of them did on the same cases."""
    record = read_record(folder / "comparison.json")
    with form_explained(folder):
        verdicts = [_law_words(one) for one in record["verdicts"]]
        table = _laws(record["rows"])
        recovered = _recovered(record["rows"])
        bounds = [
            *_least_times(record.get("median_least_times", ())),
            *_bounds(record.get("bounds_from_papers_start", ())),
        ]
    blocks = [
        table,
        *recovered,
        Charts("Settling", _settled_by_law(folder, record["rows"])),
        *bounds,
        record_provenance(record),
    ]
    verdict = Verdict(None, verdicts[0] if verdicts else "Nothing was compared.", verdicts[1:])
    return Section("Comparison of laws", f"Comparison in {folder.name}", verdict, blocks)


def _law_words(verdict: Mapping[str, Any]) -> str:
    where = _where(verdict)
    taken = f"take {verdict['law']}" if verdict["law"] else "no law to take"
    return f"{where}: {taken}; {verdict['reason']}."


def _laws(rows: list[Mapping[str, Any]]) -> Table:
    """A row for every law, limit and level."""
    columns = (
        LAW_COLUMNS
        if rows and "scenario" in rows[0]
        else {
            "level": lambda row: row["level"],
            "limit (N m)": lambda row: row["torque_limit"],
            **LAW_COLUMNS,
            "paper's start by (s)": lambda row: row["paper_start_settled_s"],
        }
    )
    cells = [[read(row) for read in columns.values()] for row in rows]
    return Table("Laws", list(columns), cells, LAWS_NOTE)


def _settled_by_law(folder: Path, rows: list[Mapping[str, Any]]) -> list[Chart]:
    """The fraction settled by a time, a line for each law, from the stores that are there."""
    charts: dict[str, dict[str, tuple[np.ndarray, np.ndarray]]] = {}
    for row in rows:
        where = _where(row)
        store = store_of_row(folder, row)
        if (store / "zarr.json").is_file():
            times = np.asarray(study_columns(store)["settling_time"])
            good = np.sort(times[np.isfinite(times)])
            share = np.arange(len(good) + 1) / max(1, len(times))
            charts.setdefault(where, {})[row["law"]] = (np.append(0.0, good), share)
    return [
        curves_chart(
            f"{where}: fraction settled by a time", laws, ("time (s)", "fraction"), steps=True
        )
        for where, laws in charts.items()
    ]


def _where(row: Mapping[str, Any]) -> str:
    """The scenario of a row or verdict, or its place in the acceptance set."""
    if "scenario" in row:
        return str(row["scenario"])
    return f"{row['level']}, {row['torque_limit']:g} N m"


def _recovered(rows: list[Mapping[str, Any]]) -> list[Table]:
    """Of failures in flight: a row for every law and kind."""
    columns = ["law", "failure", "cases", "recovered", "fraction", "low", "high", "recoverable"]
    cells = [
        [row["law"], kind, one["cases"], one["recovered"], *one["fraction"].values(),
         one["recoverable"]]
        for row in rows
        for kind, one in row.get("recovered", {}).items()
    ]  # fmt: skip
    note = "Fractions of all cases, with 95 % Wilson intervals."
    return [Table("Recovered by kind of failure", columns, cells, note)] if cells else []


def _bounds(found: Any) -> list[Table]:
    rows = [[one["torque_limit"], one["end_meaning"], one["time"], one["effort"]] for one in found]
    columns = ["limit (N m)", "end", "least time (s)", "least effort (N m s)"]
    return [Table("Least from the paper's start, open loop", columns, rows)] if rows else []


def _least_times(found: Any) -> list[Table]:
    rows = [[one["torque_limit"], one["end"], one["seconds"]] for one in found]
    columns = ["limit (N m)", "end", "median least time (s)"]
    title = "Least times of the same starts without dispersions, open loop"
    return [Table(title, columns, rows)] if rows else []


def reproduction_section(folder: Path) -> Section:
    """The paper's claims, judged again from the trajectories in the folder."""
    datasets = {name: open_trajectory(folder / f"{name}.nc") for name in RUNS}
    claims = judge(datasets)
    counts = {verdict: sum(one.verdict is verdict for one in claims) for verdict in ClaimVerdict}
    parts = [f"{verdict.value}: {n}" for verdict, n in counts.items() if n]
    text = f"{len(claims)} claims of the paper's section 5. {'; '.join(parts).capitalize()}."
    rows = [[one.source, one.statement, one.found, one.verdict_text] for one in claims]
    charts, names_of = [], list(datasets)
    for first in range(0, len(names_of), MOST_LINES):
        names = names_of[first : first + MOST_LINES]
        curves = {
            name: (
                datasets[name]["time"].values,
                np.linalg.norm(datasets[name]["omega"].values, axis=1),
            )
            for name in names
        }
        charts.append(curves_chart("Size of the angular velocity", curves, ("time (s)", "rad/s")))
    runs = [
        [f"{name}.nc", RUNS[name].purpose, str(data.attrs["outcome"])]
        for name, data in datasets.items()
    ]
    blocks = [
        Table("Claims", ["where", "claim", "found", "verdict"], rows, "Judged from these files."),
        Charts("Runs", charts),
        Table("Files", ["run", "purpose", "outcome"], runs),
        provenance_facts(next(iter(datasets.values())).attrs),
    ]
    verdict = Verdict(None, text)
    return Section("The paper's section 5", f"Reproduction in {folder.name}", verdict, blocks)
