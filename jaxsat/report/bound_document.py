"""The least time or effort of a manoeuvre, as a document of the record that `bound` writes."""

from collections.abc import Mapping
from typing import Any

from jaxsat.core.numerals import number_text
from jaxsat.report.document import Document, Facts, Verdict

UNITS = {"time": "s", "effort": "N m s"}


def bound_document(title: str, record: Mapping[str, Any]) -> Document:
    """The best manoeuvre, where it ends when it is flown again, and the other local optima."""
    flight, value = record["flown_again"], number_text(record["value"])
    unit = UNITS[record["objective"]]
    where = f"{flight['angle']:.1e} rad and {flight['rate']:.1e} rad/s from rest in the orbit frame"
    if record["target"] == "rates":
        where = f"with {flight['rate']:.1e} rad/s"
    elif record["end"] == "settled":
        tilt, turn, rate = (number_text(flight[one], 3) for one in ("tilt", "turn", "rate"))
        where = f"at {tilt} rad of tilt, {turn} rad of turn and {rate} rad/s"
    listed = ", ".join(map(number_text, record["local_optima"]))
    facts = {
        "duration": f"{number_text(record['duration_s'])} s",
        "effort": f"{number_text(flight['effort'])} N m s",
        "end": record["end_meaning"],
        "flown again": f"ends {where}",
        "local optima": f"{listed} {unit}, of {record['starts']} starts",
    }
    text = f"Least {record['objective']}: {value} {unit}, not certified."
    return Document(title, Verdict(None, text), [Facts("Best found", facts)])
