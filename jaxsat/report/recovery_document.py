"""Recovery from failures in flight, in the document of a study."""

from jaxsat.core.numerals import number_text
from jaxsat.report.cells import INTERVALS, fraction_cell
from jaxsat.report.document import Cell, Table
from jaxsat.studies import KindRecovery, RecoverySummary, percent_texts, reason_words
from jaxsat.studies.recovery_summary import SETTLING_PERCENTS

EXPLAINED = 200
"""Cases that did not recover in the table that explains them."""

SHOWN = 8
"""Those of them that text shows."""


def recovery_line(found: RecoverySummary) -> str:
    """The recovered fraction of the recoverable cases, and alarms without a failure."""
    total = found.by_kind[-1]
    text = f"Recovered: {total.settled:,} of {total.recoverable:,} recoverable cases"
    if total.of_recoverable is not None:
        fraction, low, high = percent_texts(total.of_recoverable)
        text += f" ({fraction}, 95 % interval {low} to {high})"
    if found.false_alarms is None:
        return f"{text}."
    hours = number_text(found.healthy_time / 3600)
    return f"{text}; {found.false_alarms:,} false alarms in {hours} h before any failure."


def recovery_tables(found: RecoverySummary | None) -> list[Table]:
    """By kind of failure: what recovered and why the others did not, and the diagnosis."""
    if found is None:
        return []
    columns = ["failure", "cases", "recovered", "fraction", "recoverable", "fraction of these"]
    columns += [f"settled {percent:.0f} % (s)" for percent in SETTLING_PERCENTS]
    columns.append("the others")
    rows = [_of_kind(row) for row in found.by_kind]
    note = f"Settled: the time from the last failure, of the recovered cases. {INTERVALS}"
    tables = [Table("Recovery by kind of failure", columns, rows, note)]
    told = [row for row in found.by_kind if row.diagnosis is not None]
    if told:
        tables.append(_diagnosis(told))
    if found.unrecovered:
        tables.append(_explained(found))
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
        "; ".join(f"{count} {reason_words(reason)}" for reason, count in row.reasons.items()),
    ]


def _diagnosis(told: list[KindRecovery]) -> Table:
    columns = ["failure", "cases", "detected", "correctly isolated", "with the right kind"]
    columns += [f"{what} {percent} % (s)" for what in ("alarm", "verdict") for percent in (50, 90)]
    rows: list[list[Cell]] = []
    for row in told:
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


def _explained(found: RecoverySummary) -> Table:
    rows = [
        [entry.case, reason_words(entry.reason), entry.text.partition("; ")[2]]
        for entry in found.unrecovered[:EXPLAINED]
    ]
    more = len(found.unrecovered) - len(rows)
    note = f"And {more:,} more in the store." if more else ""
    columns = ["case", "reason", "explanation"]
    return Table("Cases that did not recover", columns, rows, note, SHOWN)
