"""What `jaxsat compare` prints."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from jaxsat.core.numerals import fixed_text, number_text

if TYPE_CHECKING:
    from jaxsat.synthesis.comparison import (
        ComparisonRow,
        ComparisonVerdict,
        LeastTime,
        ScenarioComparison,
    )

ENDS = {"settled": "until settled", "rest": "to exact rest, which no law reaches"}
"""Where a manoeuvre ends, in words."""

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

NOT_IN_SCENARIO = ("N m", "level", "paper's start (s)")
"""Headings that only the acceptance set has."""


def comparison_lines(
    rows: Sequence["ComparisonRow"], verdicts: Sequence["ComparisonVerdict"]
) -> list[str]:
    """The table of all rows, and which law to take at each limit and level."""
    lines = _aligned([list(HEADINGS), *map(_cells, rows)], left=(1, 2))
    lines.append(
        f"{rows[0].cases} random starts each; t50 and t90: half and 90 % of all cases have settled "
        "(95 % interval, of the number of cases below it); median effort, largest rate"
    )
    for one in verdicts:
        where = f"{one.torque_limit:g} N m, {one.level}"
        taken = "take none" if one.law is None else f"take {one.law}"
        lines.append(f"{where}: {taken}. {one.reason[0].upper()}{one.reason[1:]}.")
    return lines


def least_time_text(found: "LeastTime") -> str:
    """By how many times the laws exceed the least times of the same starts."""
    ratios = [
        f"{law} {ratio:.2f} ({level})"
        for (level, law), ratio in found.ratios.items()
        if math.isfinite(ratio)
    ]
    over = f"; t50 over it: {', '.join(ratios)}" if ratios else ""
    return (
        f"{found.torque_limit:g} N m, open loop from the same starts without dispersions, "
        f"{ENDS[found.end]}: median least time {found.median:.1f} s (best found, not certified)"
        f"{over}"
    )


def scenario_lines(found: "ScenarioComparison") -> list[str]:
    """The table of the laws in a scenario, what recovered by kind of failure, and which to take."""
    shown = [place for place, name in enumerate(HEADINGS) if name not in NOT_IN_SCENARIO]
    cells = [[_cells(row)[place] for place in shown] for row in found.rows]
    lines = _aligned([[HEADINGS[place] for place in shown], *cells], left=(0,))
    lines.append(
        f"the same {found.rows[0].cases} cases each; t50 and t90: half and 90 % of all cases have "
        "settled (95 % interval, of the number of cases below it); median effort, largest rate"
    )
    lines += _recovered(found)
    one = found.verdict
    taken = "take none" if one.law is None else f"take {one.law}"
    return [*lines, f"{taken}. {one.reason[0].upper()}{one.reason[1:]}."]


def _recovered(found: "ScenarioComparison") -> list[str]:
    """A row for every kind of failure and a column for every law; nothing without failures."""
    from jaxsat.studies import percent_texts

    told = [
        (row.setting.law, {one.kind: one for one in recovery.by_kind})
        for row, recovery in zip(found.rows, found.recoveries, strict=True)
        if recovery is not None
    ]
    if not told:
        return []
    table = [["failure", "cases", "recoverable", *(f"{law}: recovered" for law, _ in told)]]
    for kind, first in told[0][1].items():
        cells = [kind, str(first.cases), str(max(one[kind].recoverable for _, one in told))]
        for _, one in told:
            _, low, high = percent_texts(one[kind].recovered)
            cells.append(f"{one[kind].settled} ({low} to {high})")
        table.append(cells)
    return _aligned(table, left=(0,))


def _aligned(lines: Sequence[Sequence[str]], left: Sequence[int]) -> list[str]:
    """Columns of equal width, names to the `left` and numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if place in left else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]


def _cells(row: "ComparisonRow") -> list[str]:
    settled = row.settled
    return [
        *_setting_cells(row.setting),
        f"{settled.value:.1%}",
        f"{settled.low:.1%} to {settled.high:.1%}",
        _interval(row.t50),
        _interval(row.t90),
        _number(row.effort, number_text),
        _number(row.peak_rate, partial(number_text, digits=2)),
        _number(row.paper_start, _SECONDS),
    ]


def _setting_cells(setting) -> list[str]:
    law = [setting.law]
    if hasattr(setting, "torque_limit"):
        return [f"{setting.torque_limit:g}", setting.level, *law]
    return ["", "", *law]


def _interval(found) -> str:
    from jaxsat.studies import ends_text

    if not math.isfinite(found.low) and not math.isfinite(found.value):
        return "never"
    return f"{_number(found.value, _SECONDS)} ({ends_text(found, _SECONDS)})"


_SECONDS = partial(fixed_text, places=0)


def _number(value: float, shown: Callable[[float], str]) -> str:
    return shown(value) if math.isfinite(value) else "never"


def least_text(least: dict[str, Any]) -> str:
    """Least time and effort from the paper's start at one torque limit."""
    found = [
        "none found" if value is None else f"{number_text(value, 3)} {unit}"
        for value, unit in ((least["time"], "s"), (least["effort"], "N m s"))
    ]
    return (
        f"{least['torque_limit']:g} N m, open loop from the paper's start, {ENDS[least['end']]}: "
        f"least time {found[0]}, least effort {found[1]} (best of {least['starts']} starts and the "
        "planner's, not certified)"
    )
