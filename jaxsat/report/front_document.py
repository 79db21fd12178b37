"""Time against effort, of plans and of laws, as a document of the record `front.json`."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from jaxsat.report.document import Cell, Document, Table, Verdict


def front_document(title: str, record: Mapping[str, Any]) -> Document:
    """The front under every torque limit, with the laws beside it."""
    rows = [row for front in record["fronts"] for row in _rows(front)]
    columns = ["N m", "by", "time (s)", "effort (N m s)"]
    text = f"Plans end {record['end_meaning']}; laws where they settle."
    note = "Plans are local optima, not certified."
    table = Table("Least effort within a time", columns, rows, note)
    return Document(f"{title}: time against effort", Verdict(None, text), [table])


def _rows(front: Mapping[str, Any]) -> Iterator[Sequence[Cell]]:
    limit = front["torque_limit_N_m"]
    for one in front["front"]:
        yield [limit, "plan", one["duration_s"], one["effort_N_m_s"]]
    for duration in front["failed_durations_s"]:
        yield [limit, "no plan", duration, None]
    for one in front["laws"]:
        settles = one["settled_from_s"] is not None
        by = one["law"] if settles else f"{one['law']}, which does not settle"
        yield [limit, by, one["settled_from_s"], one["effort_N_m_s"]]
