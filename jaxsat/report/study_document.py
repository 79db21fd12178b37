"""What a study found, as a document."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from jaxsat.core.numerals import number_text
from jaxsat.report.cells import INTERVALS, interval_cell, step_error
from jaxsat.report.document import Cell, Document, Lines, Shown, Table, Verdict
from jaxsat.report.facts import settled_meaning
from jaxsat.report.recovery_document import recovery_line, recovery_tables
from jaxsat.studies import Interval, Sensitivity, Summary, ends_text, percent_texts

SHOWN = 8
"""Numbers of a sensitivity ranking that text shows."""

PERCENTILES = {
    "settling_time": "settling time (s), of those that settle",
    "effort": "effort (N m s), of those that end",
    "propellant": "propellant (kg), of those that end",
    "valve_openings": "openings of all valves, of those that end",
    "peak_wheel_momentum": "largest momentum of any wheel (N m s), of those that end",
}
"""What is told in percentiles, by its name in the summary."""


def study_document(summary: Summary, scenario: Mapping[str, Any], again: str = "") -> Document:
    """The settled fraction, percentiles, recovery and sensitivities; of a scenario's tables.

    `again` says how one of the worst cases is flown again.
    """
    law = scenario.get("control", {}).get("law", "unknown")
    title = f"{summary.cases:,} cases under the law {law}"
    percentiles = {name: getattr(summary, name) for name in PERCENTILES}
    if not any(one is not None and one.value > 0 for one in summary.propellant.values()):
        del percentiles["propellant"]  # counted of thrusters with a specific impulse alone
    blocks = [
        *percentile_table(percentiles, "Percentiles"),
        *recovery_tables(summary.recovery),
        *rankings(summary),
    ]
    meaning = settled_meaning(scenario, of_study=True)
    return Document(title, study_verdict(summary, meaning, again), blocks)


def study_verdict(summary: Summary, settled: str, again: str = "") -> Verdict:
    """The settled fraction with its interval, what `settled` means, how the others ended, the worst
    cases."""
    fraction, low, high = percent_texts(summary.settled)
    interval = f"95 % interval {low} to {high}"
    text = f"{fraction} of {summary.cases:,} cases settle ({interval})."
    outcomes = ", ".join(f"{count:,} {name}" for name, count in summary.outcomes.items())
    more = [f"Settled means {settled}.", f"Outcomes: {outcomes}."]
    if summary.recovery is not None:
        more.append(recovery_line(summary.recovery))
    error = step_error(summary.rate_error, summary.attitude_error)
    more += [f"The steps leave errors of {error}."] if error else []
    listed = ", ".join(map(str, summary.worst[:SHOWN]))
    more.append(f"Worst cases: {listed}. {again}".rstrip())
    return Verdict(None, text, more)


def percentile_table(
    found: Mapping[str, Mapping[float, Interval | None]], title: str, note: str = ""
) -> list[Table]:
    """Percentiles by the names of `PERCENTILES` and percent; none where no case ends."""
    told = {PERCENTILES[name]: by_percent for name, by_percent in found.items() if by_percent}
    if not told:
        return []
    percents = next(iter(told.values()))
    rows = [[label, *map(interval_cell, one.values())] for label, one in told.items()]
    columns = ["quantity", *(f"{one:g} %" for one in percents)]
    return [Table(title, columns, rows, f"{note} {INTERVALS}".strip())]


def rankings(summary: Summary) -> Iterator[Table | Lines]:
    """On which dispersed numbers settling and the cost depend; nothing where they do not vary."""
    found = {"settling": summary.settling_sensitivity, "the cost": summary.cost_sensitivity}
    for result, ranking in found.items():
        known = [one for one in ranking if np.isfinite(one.first_order.value)]
        if any(one.matters for one in known):
            yield _ranking(f"Sensitivity of {result}", known)
        elif known:
            told = "No dependence is significant with this number of cases."
            yield Lines(f"Sensitivity of {result}", [told])


def _short(value: float) -> str:
    return number_text(value, 3)


def _ranking(title: str, known: list[Sensitivity]) -> Table:
    known = sorted(known, key=lambda one: not one.matters)
    rows: list[list[Cell]] = [
        [
            one.name,
            *(
                Shown(f"{_short(part.value)} ({ends_text(part, _short)})", part.value)
                for part in (one.first_order, one.rank_correlation)
            ),
            "yes" if one.matters else "no",
        ]
        for one in known
    ]
    columns = ["quantity", "first-order index", "rank correlation", "significant"]
    note = "The 95 % intervals hold simultaneously."
    first = min(SHOWN, sum(one.matters for one in known))
    return Table(title, columns, rows, note, first)
