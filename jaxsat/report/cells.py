"""Intervals as cells of a table, and as they stand in records of results."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxsat.core.numerals import number_text
from jaxsat.report.document import Shown
from jaxsat.studies import Interval, ends_text, fraction_text

INTERVALS = "Intervals are of 95 %."


def fraction_cell(found: Interval) -> Shown:
    """A fraction with its interval, "99.90% (99.64% to 99.97%)"."""
    return Shown(fraction_text(found), found.value)


def interval_cell(found: Interval | None, missing: str = "–") -> Shown:
    """A number with its interval; `missing` where there is none, as of cases that never settle."""
    if found is None or not np.isfinite(found.value):
        return Shown(missing, float("inf"))
    return Shown(f"{number_text(found.value)} ({ends_text(found)})", found.value)


def interval_of(record: Mapping[str, Any] | None) -> Interval | None:
    """The interval in a record, which has None for ends that are open and numbers that lack."""
    if record is None or record.get("value") is None:
        return None
    low, high = record.get("low"), record.get("high")
    return Interval(
        record["value"], -np.inf if low is None else low, np.inf if high is None else high
    )


def step_error(rate: float | None, attitude: float | None) -> str:
    """What equal steps leave, rad/s and rad; nothing without estimates."""
    if rate is None or attitude is None:
        return ""
    sizes = f"{number_text(rate, 2)} rad/s and {number_text(attitude, 2)} rad"
    return f"up to {sizes}, compared with steps of half the length"
