"""What `jaxsat compare` prints."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jaxsat.comparison import ComparisonRow, ComparisonVerdict

HEADINGS = (
    "N m",
    "level",
    "law",
    "settled",
    "95 % interval",
    "t50 (s)",
    "t90 (s)",
    "effort (N m s)",
    "peak rate (rad/s)",
    "paper's start (s)",
)


def comparison_lines(
    rows: Sequence["ComparisonRow"], verdicts: Sequence["ComparisonVerdict"]
) -> list[str]:
    """The table of all rows, and which law to take at each limit and level."""
    lines = _aligned([list(HEADINGS), *map(_cells, rows)])
    lines.append(
        f"{rows[0].cases} random starts each; t50 and t90: half and 90 % of all cases have settled "
        "(95 % interval, of the number of cases below it); median effort, largest rate"
    )
    for one in verdicts:
        where = f"{one.torque_limit:g} N m, {one.level}"
        taken = "take none" if one.law is None else f"take {one.law}"
        lines.append(f"{where}: {taken}. {one.reason[0].upper()}{one.reason[1:]}.")
    return lines


def _aligned(lines: Sequence[Sequence[str]]) -> list[str]:
    """Columns of equal width, the names of level and law to the left and numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if place in (1, 2) else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]


def _cells(row: "ComparisonRow") -> list[str]:
    settled = row.settled
    return [
        f"{row.setting.torque_limit:g}",
        row.setting.level,
        row.setting.law,
        f"{settled.value:.1%}",
        f"{settled.low:.1%} to {settled.high:.1%}",
        _interval(row.t50),
        _interval(row.t90),
        _number(row.effort, ".0f"),
        _number(row.peak_rate, ".2g"),
        _number(row.paper_start, ".0f"),
    ]


def _interval(found) -> str:
    from jaxsat.montecarlo import ends_text

    if not math.isfinite(found.low) and not math.isfinite(found.value):
        return "never"
    return f"{_number(found.value, '.0f')} ({ends_text(found, '.0f')})"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "never"


def least_text(least: dict[str, Any]) -> str:
    """Least time and effort from the paper's start at one torque limit."""
    found = [
        "none found" if value is None else f"{value:.3g} {unit}"
        for value, unit in ((least["time"], "s"), (least["effort"], "N m s"))
    ]
    return (
        f"{least['torque_limit']:g} N m, open loop from the paper's start: least time {found[0]}, "
        f"least effort {found[1]} (best of {least['starts']} starts, not certified)"
    )
