"""Document of a study, and cells with intervals for other documents."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from jaxsat.core.declaration.actuators import STUDIED
from jaxsat.core.text import number_text
from jaxsat.report.document import Cell, Document, Lines, Shown, Table, Verdict
from jaxsat.report.facts import settled_meaning, step_error
from jaxsat.report.requirements import study_requirements
from jaxsat.report.timeline import words_of
from jaxsat.studies.columns import UNMADE
from jaxsat.studies.recovery_summary import (
    SETTLING_PERCENTS,
    KindRecovery,
    RecoverySummary,
)
from jaxsat.studies.sensitivities import Sensitivity
from jaxsat.studies.statistics import Interval, fraction_text, interval_text, percent_texts
from jaxsat.studies.summary import Summary

EXPLAINED = 200
"""Largest number of cases in the table that explains failed recoveries."""

SHOWN = 8
"""Number of worst cases, of ranked quantities and of failed recoveries that text shows."""

PERCENTILES = {
    "settling_time": "settling time (s), over settled cases",
    "effort": "effort (N m s), over completed cases",
    **{name: f"{one.overall}, over completed cases" for name, (one, _) in STUDIED.items()},
    "peak_torque_unmade": "largest unmet torque (N m), over completed cases",
    "unmade_fraction": "fraction of samples with unmet torque, over completed cases",
}
"""Quantities reported in percentiles, by their names in the summary."""

MUTE = {*UNMADE, *(name for name, (one, _) in STUDIED.items() if one.mute)}
"""Names of quantities that are left out where all their numbers are zero."""

INTERVALS = "Intervals are of 95 %."


def study_document(summary: Summary, scenario: Mapping[str, Any], again: str = "") -> Document:
    """Return the document: settled fraction, percentiles, recovery and sensitivities.

    `scenario` has the tables of its scenario, and `again` says how to fly one of the worst cases
    again.
    """
    law = scenario.get("control", {}).get("law", "unknown")
    title = f"{summary.cases:,} cases under the law {law}"
    percentiles = {"settling_time": summary.settling_time, "effort": summary.effort}
    percentiles |= {
        name: estimates
        for name, estimates in summary.actuators.items()
        if name not in MUTE or any(one.value > 0 for one in estimates.values() if one)
    }
    blocks = [
        *study_requirements(summary.requirements, scenario),
        *percentile_table(percentiles, "Percentiles"),
        *recovery_tables(summary.recovery),
        *sensor_table(summary),
        *rankings(summary),
    ]
    return Document(title, study_verdict(summary, scenario, again), blocks)


def study_verdict(summary: Summary, scenario: Mapping[str, Any], again: str = "") -> Verdict:
    """Return the verdict: settled fraction, tolerances, outcomes, errors of steps, worst cases."""
    settled = settled_meaning(scenario, of_study=True)
    fraction, low, high = percent_texts(summary.settled)
    interval = f"95 % interval {low} to {high}"
    text = f"{fraction} of {summary.cases:,} cases settle ({interval})."
    outcomes = ", ".join(f"{count:,} {name}" for name, count in summary.outcomes.items())
    more = [f"Settled means {settled}.", f"Outcomes: {outcomes}."]
    if summary.recovery is not None:
        more.append(recovery_line(summary.recovery))
    more += _steps(summary, scenario)
    numbers = ", ".join(map(str, summary.worst[:SHOWN]))
    more.append(f"Worst cases: {numbers}. {again}".rstrip())
    return Verdict(None, text, more)


def _steps(summary: Summary, scenario: Mapping[str, Any]) -> list[str]:
    """Describe solver errors, and whether the scenario allows them; empty without estimates."""
    errors = (summary.rate_error, summary.attitude_error)
    text = step_error(*errors)
    if not text:
        return []
    solver = scenario.get("simulation", {}).get("solver", {})
    limits = [solver.get(key, np.inf) for key in ("rate_error_rad_s", "attitude_error_rad")]
    if all(error <= most for error, most in zip(errors, limits, strict=True) if error is not None):
        return [f"Integration errors are {text}."]
    most = f"{number_text(limits[0], 2)} rad/s and {number_text(limits[1], 2)} rad"
    return [f"Integration errors are {text}: more than the scenario allows, {most}."]


def percentile_table(
    quantities: Mapping[str, Mapping[float, Interval | None]], title: str, note: str = ""
) -> list[Table]:
    """Return percentiles by the names of `PERCENTILES` and percent; empty where no case ends."""
    by_label = {
        PERCENTILES[name]: by_percent for name, by_percent in quantities.items() if by_percent
    }
    if not by_label:
        return []
    percents = next(iter(by_label.values()))
    rows = [[label, *map(interval_cell, one.values())] for label, one in by_label.items()]
    columns = ["quantity", *(f"{one:g} %" for one in percents)]
    return [Table(title, columns, rows, f"{note} {INTERVALS}".strip())]


def sensor_table(summary: Summary) -> list[Table]:
    """Return a table of rejected readings and of exclusions of the attitude sensors, if any."""
    if not any(one.rejected for one in summary.sensors):
        return []
    columns = ["sensor", "rejected readings", "excluded in cases"]
    rows: list[list[Cell]] = [
        [words_of(one.name), one.rejected, fraction_cell(one.excluded)] for one in summary.sensors
    ]
    return [Table("Sensors of the attitude", columns, rows, INTERVALS)]


def rankings(summary: Summary) -> Iterator[Table | Lines]:
    """Yield tables of the dispersed numbers on which settling and cost depend, where they vary."""
    sensitivities = {"settling": summary.settling_sensitivity, "the cost": summary.cost_sensitivity}
    for result, ranking in sensitivities.items():
        finite = [one for one in ranking if np.isfinite(one.first_order.value)]
        if any(one.matters for one in finite):
            yield _ranking(f"Sensitivity of {result}", finite)
        elif finite:
            message = "No dependence is significant with this number of cases."
            yield Lines(f"Sensitivity of {result}", [message])


def _ranking(title: str, ranking: list[Sensitivity]) -> Table:
    ranking = sorted(ranking, key=lambda one: not one.matters)
    rows: list[list[Cell]] = [
        [
            one.name,
            *(
                Shown(interval_text(part, lambda value: number_text(value, 3)), part.value)
                for part in (one.first_order, one.rank_correlation)
            ),
            "yes" if one.matters else "no",
        ]
        for one in ranking
    ]
    columns = ["quantity", "first-order index", "rank correlation", "significant"]
    note = "The 95 % intervals hold simultaneously."
    first = min(SHOWN, sum(one.matters for one in ranking))
    return Table(title, columns, rows, note, first)


def recovery_line(recovery: RecoverySummary) -> str:
    """Describe the recovered fraction of the recoverable cases, and alarms without a failure."""
    total = recovery.by_kind[-1]
    text = f"Recovered: {total.settled:,} of {total.recoverable:,} recoverable cases"
    if total.of_recoverable is not None:
        fraction, low, high = percent_texts(total.of_recoverable)
        text += f" ({fraction}, 95 % interval {low} to {high})"
    if recovery.false_alarms is None:
        return f"{text}."
    hours = number_text(recovery.healthy_time / 3600)
    return f"{text}; {recovery.false_alarms:,} false alarms in {hours} h before any failure."


def recovery_tables(recovery: RecoverySummary | None) -> list[Table]:
    """Return tables by kind of failure: recoveries, reasons of the others, and the diagnosis."""
    if recovery is None:
        return []
    columns = ["failure", "cases", "recovered", "fraction", "recoverable", "fraction of these"]
    columns += [f"settled {percent:.0f} % (s)" for percent in SETTLING_PERCENTS]
    columns.append("not recovered")
    rows = [_of_kind(row) for row in recovery.by_kind]
    note = f"Settled: the time from the last failure, of the recovered cases. {INTERVALS}"
    tables = [Table("Recovery by kind of failure", columns, rows, note)]
    diagnosed_rows = [row for row in recovery.by_kind if row.diagnosis is not None]
    if diagnosed_rows:
        tables.append(_diagnosis(diagnosed_rows))
    if recovery.unrecovered:
        tables.append(_explanation_table(recovery))
    return tables


def _of_kind(row: KindRecovery) -> list[Cell]:
    return [
        row.kind,
        row.cases,
        row.settled,
        fraction_cell(row.recovered),
        row.recoverable,
        None if row.of_recoverable is None else fraction_cell(row.of_recoverable),
        *(
            row.settling_delay[one].value if row.settling_delay else None
            for one in SETTLING_PERCENTS
        ),
        "; ".join(f"{count} {reason.explanation}" for reason, count in row.reasons.items()),
    ]


def _diagnosis(kinds: list[KindRecovery]) -> Table:
    columns = ["failure", "cases", "detected", "correctly isolated", "with the correct kind"]
    columns += [f"{what} {percent} % (s)" for what in ("alarm", "verdict") for percent in (50, 90)]
    rows: list[list[Cell]] = []
    for row in kinds:
        one = row.diagnosis
        assert one is not None
        delays = [
            late[percent].value if percent in late else None
            for late in (one.detection_delay, one.isolation_delay)
            for percent in (50.0, 90.0)
        ]
        rows.append([row.kind, row.cases, one.detected, one.isolated, one.as_kind, *delays])
    note = "Delays from the failure to the alarm, and from the alarm to the verdict."
    return Table("Diagnosis by kind of failure", columns, rows, note)


def _explanation_table(recovery: RecoverySummary) -> Table:
    rows = [
        [entry.case, entry.reason.explanation, entry.text.partition("; ")[2]]
        for entry in recovery.unrecovered[:EXPLAINED]
    ]
    more = len(recovery.unrecovered) - len(rows)
    note = f"And {more:,} more in the store." if more else ""
    columns = ["case", "reason", "explanation"]
    return Table("Cases that did not recover", columns, rows, note, SHOWN)


def fraction_cell(interval: Interval) -> Shown:
    """Format a fraction with its interval, "99.90% (99.64% to 99.97%)"."""
    return Shown(fraction_text(interval), interval.value)


def interval_cell(interval: Interval | None, missing: str = "–") -> Shown:
    """Format a number with its interval; `missing` for infinite ones, as of unsettled cases."""
    if interval is None or not np.isfinite(interval.value):
        return Shown(missing, float("inf"))
    return Shown(interval_text(interval), interval.value)


def interval_of(record: Mapping[str, Any] | None) -> Interval | None:
    """Return the interval of a record, which has None for infinite ends and missing numbers."""
    if record is None or record.get("value") is None:
        return None
    low, high = record.get("low"), record.get("high")
    return Interval(
        record["value"], -np.inf if low is None else low, np.inf if high is None else high
    )
