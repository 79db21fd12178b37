"""Document of a comparison of laws, from the record `comparison.json`."""

from collections.abc import Iterable, Iterator, Sequence

from jaxsat.core.text import capitalised
from jaxsat.report.document import Cell, Document, Record, Shown, Table, Verdict
from jaxsat.report.study_document import fraction_cell, interval_cell, interval_of
from jaxsat.studies.statistics import percent_texts

ENDS = {"settled": "settled", "rest": "exact rest, which no law reaches"}
"""Description of the ends of a manoeuvre."""

LAW_COLUMNS = ("law", "cases", "settled", "t50 (s)", "t90 (s)", "effort (N m s)",
               "peak rate (rad/s)")  # fmt: skip
"""Headings of the cells of `law_cells`."""

LAWS_NOTE = (
    "t50 and t90: half and 90 % of all cases have settled; effort: the median; peak rate: the "
    "largest. Intervals are of 95 %, those of times by the number of cases below."
)

PRICES = {"propellant_kg_day": "propellant (kg a day)", "momentum_margin": "momentum margin",
          "pointing_error_deg": "pointing error at the end (deg)"}  # fmt: skip
"""Prices of a law in a scenario, and their headings."""

PRICES_NOTE = (
    "Medians over completed cases. Propellant: a day's at the mean use of a case, manoeuvres and "
    "failures included; momentum margin: the part of its limit that the fullest wheel never holds."
)


def comparison_document(record: Record) -> Document:
    """Return the document: recommended laws, all laws, failures in flight, and least times.

    Raises `KeyError` or `TypeError` for a record of another form.
    """
    rows = record["rows"]
    sentences = [f"{place_of(one)}: {_recommendation(one)}" for one in record["verdicts"]]
    verdict = Verdict(None, sentences[0] if sentences else "Nothing was compared.", sentences[1:])
    blocks = [
        _laws(rows, record.get("median_least_times", ())),
        *price_table(rows),
        *_recovery_tables(rows),
        *_bounds(record.get("bounds_from_papers_start", ())),
    ]
    return Document("Comparison of laws", verdict, blocks)


def place_of(row: Record) -> str:
    """Return the scenario of a row or verdict, or its place in the acceptance set."""
    if "scenario" in row:
        return str(row["scenario"])
    return f"{row['level']}, {row['torque_limit']:g} N m"


def law_cells(row: Record) -> list[Cell]:
    """Return the cells of a row of a comparison, by `LAW_COLUMNS`."""
    settled = interval_of(row["settled"])
    return [
        row["law"],
        row["cases"],
        None if settled is None else fraction_cell(settled),
        *(interval_cell(interval_of(row[name]), "never") for name in ("t50", "t90")),
        row["effort_N_m_s"],
        row["peak_rate_rad_s"],
    ]


def price_table(rows: Iterable[Record], place: Sequence[str] = ()) -> Iterator[Table]:
    """Yield the table of each law's prices, if any row has them.

    `place` names the keys of a row that identify it beside its law.
    """
    rows = [row for row in rows if any(one is not None for one in row.get("prices", {}).values())]
    prices = {
        name: heading
        for name, heading in PRICES.items()
        if any(row["prices"][name] is not None for row in rows)
    }
    if prices:
        cells = [
            [*(row[key] for key in (*place, "law")), *(row["prices"][name] for name in prices)]
            for row in rows
        ]
        yield Table("Prices of the laws", [*place, "law", *prices.values()], cells, PRICES_NOTE)


def _recommendation(verdict: Record) -> str:
    law = verdict["law"]
    advice = f"the recommended law is {law}" if law else "no law is recommended"
    return f"{advice}. {capitalised(verdict['reason'])}."


def _laws(rows: Sequence[Record], least: Sequence[Record]) -> Table:
    if rows and "scenario" in rows[0]:
        note = f"The same cases under each law. {LAWS_NOTE}"
        return Table("Laws", LAW_COLUMNS, [law_cells(row) for row in rows], note)
    columns = ["N m", "level", *LAW_COLUMNS, "paper's start (s)"]
    cells: list[list[Cell]] = []
    for row in rows:
        start = row["paper_start_settled_s"]
        last = Shown("never", float("inf")) if start is None else start
        cells.append([row["torque_limit"], row["level"], *law_cells(row), last])
    if any(one["end"] == "settled" for one in least):
        columns.append("t50 / least time")
        medians = {one["torque_limit"]: one["seconds"] for one in least}
        for row, line in zip(rows, cells, strict=True):
            time, median = row["t50"]["value"], medians.get(row["torque_limit"])
            line.append(None if None in (time, median) else time / median)
    note = [f"The same random starts under each law. {LAWS_NOTE}", *map(_least_time, least)]
    return Table("Laws", columns, cells, " ".join(note))


def _least_time(record: Record) -> str:
    return (
        f"Median least time of the same starts with {record['torque_limit']:g} N m, open loop and "
        f"without dispersions, until {ENDS[record['end']]}: {record['seconds']:.1f} s (best found, "
        "not certified)."
    )


def _recovery_tables(rows: Sequence[Record]) -> Iterator[Table]:
    by_law = {row["law"]: row["recovered"] for row in rows if "recovered" in row}
    if not by_law:
        return
    cells: list[list[Cell]] = []
    for kind, first in next(iter(by_law.values())).items():
        recoverable = max(one[kind]["recoverable"] for one in by_law.values())
        cells.append(
            [kind, first["cases"], recoverable, *(_share(one[kind]) for one in by_law.values())]
        )
    columns = ["failure", "cases", "recoverable", *(f"{law}: recovered" for law in by_law)]
    note = "With 95 % intervals of the fraction of all cases."
    yield Table("Recovered by kind of failure", columns, cells, note)


def _share(record: Record) -> Shown:
    fraction = interval_of(record["fraction"])
    assert fraction is not None
    _, low, high = percent_texts(fraction)
    return Shown(f"{record['recovered']} ({low} to {high})", record["recovered"])


def _bounds(records: Sequence[Record]) -> Iterator[Table]:
    if not records:
        return
    rows: list[list[Cell]] = [
        [one["torque_limit"], ENDS[one["end"]], one["time"], one["effort"]] for one in records
    ]
    columns = ["N m", "until", "least time (s)", "least effort (N m s)"]
    starts = records[0]["starts"]
    note = f"Best of {starts} starts and the planner's, not certified."
    yield Table("Least from the paper's start, open loop", columns, rows, note)
