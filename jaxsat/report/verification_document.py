"""Document of a verification, from its record, and tables in CSV."""

from collections.abc import Iterator

from jaxsat.core.text import csv_text, number_text
from jaxsat.report.document import Block, Cell, Document, Lines, Record, Shown, Table, Verdict
from jaxsat.studies.statistics import Interval, fraction_text

GOOD = {"met": True, "violated": False, **dict.fromkeys(("undecided", "not judged", "not tried"))}
"""Sign of verdicts: good, bad or neither."""

FIRST = 12
"""Number of failures that text shows."""

MATRIX_COLUMNS = (
    "requirement", "condition", "verdict", "cases", "met", "least_margin", "unit", "signal",
    "decided_at_s", "worst_case", "command",
)  # fmt: skip

FAILURE_COLUMNS = (
    "device", "failure", "severity", "cases", "left", "detected", "detection_time_s", "isolated",
    "recovered", "settling_time_s", "propellant_kg", "violated", "requirement", "least_margin",
    "unit", "worst_case", "command",
)  # fmt: skip

FAILURE_NAMES = ("device", "failure", "severity", "cases", "left", "detected", "detection_time",
                 "isolated", "recovered", "settling_time", "propellant")  # fmt: skip
"""Numbers of a failure's row that the document and the CSV file share."""


def verification_document(record: Record) -> Document:
    """Return the document: verdict on each requirement, evidence, failures, and untried conditions.

    Raises `KeyError` or `TypeError` for a record of another form.
    """
    blocks: list[Block] = [_requirements(record), _matrix(record)]
    if record["failures"]:
        blocks.append(_failures(record))
    if record["not_tried"]:
        blocks.append(Lines("Not tried", record["not_tried"]))
    return Document(f"Verification: {record['title']}", _verdict(record), blocks)


def _verdict(record: Record) -> Verdict:
    verdicts = {one["id"]: one["verdict"] for one in record["requirements"]}
    met = [name for name, verdict in verdicts.items() if verdict == "met"]
    demand = record["demand"]
    text = f"{len(met)} of {len(verdicts)} requirements are verified."
    more = [
        f"Required: at least {100 * demand['fraction']:.6g} % of all cases meet each requirement "
        f"under each condition, shown with {100 * demand['confidence']:.6g} % confidence for all "
        "together."
    ]
    for verdict in GOOD:
        if verdict == "met":
            continue
        names = ", ".join(name for name, one in verdicts.items() if one == verdict)
        if names:
            more.append(f"{verdict.capitalize()}: {names}.")
    return Verdict(len(met) == len(verdicts), text, more)


def _requirements(record: Record) -> Table:
    rows: list[list[Cell]] = [
        [one["id"], one["text"], Shown(one["verdict"], None, GOOD[one["verdict"]])]
        for one in record["requirements"]
    ]
    note = (
        "The verdict is the worst one under any condition that tries the requirement: where none "
        "of its windows begins, as where nothing fails, there is nothing to judge."
    )
    return Table("Requirements", ["requirement", "text", "verdict"], rows, note)


def _matrix(record: Record) -> Table:
    columns = ["requirement", "condition", "verdict", "cases", "met", "least margin", "decided at",
               "flown again by"]  # fmt: skip
    rows = [list(_matrix_cells(one)) for one in record["shown"]]
    note = "Intervals hold for all requirements and conditions together, at any number of cases."
    return Table("Traceability", columns, rows, note)


def _matrix_cells(one: Record) -> Iterator[Cell]:
    yield one["requirement"]
    yield one["condition"]
    yield Shown(one["verdict"], None, GOOD[one["verdict"]])
    yield one["cases"]
    fraction = one["fraction"]
    if fraction is None:
        yield None
    else:
        interval = Interval(**fraction)
        yield Shown(fraction_text(interval), interval.value)
    yield _margin(one, one["signal"])
    yield None if one["time"] is None else Shown(f"{number_text(one['time'], 6)} s", one["time"])
    yield f"`{one['command']}`" if one["command"] else None


def _failures(record: Record) -> Table:
    columns = ["device", "failure", "severity", "cases", "left", "detected", "after (s)",
               "isolated", "recovered", "settled after (s)", "propellant (kg)", "least margin",
               "violated"]  # fmt: skip
    worst_first = sorted(record["failures"], key=_rank)
    note = (
        "Those that violate requirements most come first. Critical: some case does not recover; "
        "major: all recover, but some violate a requirement. Times are medians: from the failure "
        "to its detection, and until recovered cases had settled. The margin is the least one of "
        "the requirement that fewest cases meet; the last column counts the cases that violate one."
    )
    return Table(
        "Failures", columns, [list(_failure_cells(one)) for one in worst_first], note, FIRST
    )


def _rank(one: Record) -> tuple[float, float]:
    """Return a sorting key of failures, the worst first."""
    least = min(one["met"].values(), default=one["cases"])
    return least / one["cases"], one["recovered"] / one["cases"]


def _failure_cells(one: Record) -> Iterator[Cell]:
    yield from (one[name] for name in FAILURE_NAMES)
    yield _margin(one, one["requirement"])
    violations = _violations(one)
    yield Shown(violations or "none", None, not violations)


def _margin(one: Record, owner: str) -> Cell:
    if one["margin"] is None:
        return None
    margin = f"{number_text(one['margin'], 4)} {one['unit']}".strip()
    return Shown(f"{margin} of {owner}", one["margin"])


def _violations(one: Record) -> str:
    """Describe violated requirements with the number of cases, such as "POINT-1 in 3"."""
    violations = {name: one["cases"] - met for name, met in one["met"].items()}
    return ", ".join(f"{name} in {count}" for name, count in violations.items() if count)


def matrix_csv(record: Record) -> str:
    """Return the traceability matrix: a row for each requirement and condition."""
    names = ("requirement", "condition", "verdict", "cases", "met", "margin", "unit", "signal",
             "time", "worst", "command")  # fmt: skip
    return csv_text([MATRIX_COLUMNS, *([one[name] for name in names] for one in record["shown"])])


def failure_csv(record: Record) -> str:
    """Return the failure table: a row for each device and kind of failure."""
    rows = (
        [
            *(one[name] for name in FAILURE_NAMES),
            _violations(one),
            *(one[name] for name in ("requirement", "margin", "unit", "worst", "command")),
        ]
        for one in record["failures"]
    )
    return csv_text([FAILURE_COLUMNS, *rows])
