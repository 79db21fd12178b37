"""Text about studies: progress and results."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jaxsat.cli.integration_error import error_row
from jaxsat.core.numerals import fixed_text, number_text

if TYPE_CHECKING:
    from jaxsat.studies import Interval, RecoverySummary, Sensitivity, StudyProgress, Summary

SHOWN = 8
"""Entries of a sensitivity ranking that are printed."""

_PERCENTILES = {
    "settling_time": ("settling time", "s, of those that settle"),
    "effort": ("effort", "N m s, of those that end"),
    "propellant": ("propellant", "kg, of those that end"),
    "valve_openings": ("valve openings", "of all valves, of those that end"),
    "peak_wheel_momentum": ("wheel momentum", "N m s at the peak of any wheel, of those that end"),
}
"""What is told in percentiles, by its name in the summary: title, and unit with whose it is."""


def summary_lines(summary: "Summary") -> list[str]:
    """What a study found, for a person."""
    from jaxsat.studies import ends_text, percent_texts

    settled, low, high = percent_texts(summary.settled)
    lines = [
        f"cases            {summary.cases}: "
        + ", ".join(f"{number} {name}" for name, number in summary.outcomes.items()),
        f"settled          {settled} (95 % interval {low} to {high})",
    ]
    for name, (title, unit) in _PERCENTILES.items():
        parts = [
            f"{percent:g} %: {number_text(found.value)} ({ends_text(found)})"
            for percent, found in getattr(summary, name).items()
        ]
        if parts:
            lines.append(f"{title:<16} {', '.join(parts)} {unit}")
    errors = error_row((summary.rate_error, summary.attitude_error))
    lines += [f"{title:<16} {text}" for title, text in errors.items()]
    lines += recovery_lines(summary.recovery)
    lines.append(f"worst cases      {', '.join(map(str, summary.worst))} (see --case)")
    rankings = {"the cost": summary.cost_sensitivity, "settling": summary.settling_sensitivity}
    for result, ranking in rankings.items():
        lines += _ranking_lines(result, ranking)
    return lines


def recovery_lines(found: "RecoverySummary | None") -> Iterator[str]:
    """What came of failures in flight: by kind, the alarms without one, and the cases explained."""
    if found is None:
        return
    from jaxsat.studies import percent_texts, reason_words

    yield "recovered, by kind of failure (95 % intervals)"
    width = max(len(row.kind) for row in found.by_kind)
    for row in found.by_kind:
        _, low, high = percent_texts(row.recovered)
        line = f"  {row.kind:<{width}}  {row.settled} of {row.cases}, {low} to {high}"
        if row.recoverable < row.cases and row.of_recoverable is not None:
            _, low, high = percent_texts(row.of_recoverable)
            line += f"; {row.settled} of {row.recoverable} recoverable, {low} to {high}"
        yield line + "".join(
            f"; {number} {reason_words(reason)}" for reason, number in row.reasons.items()
        )
    told = [row for row in found.by_kind if row.settling_delay]
    if told:
        yield "settled after the last failure (50 %, 90 % and 99 % of the recovered cases)"
    for row in told:
        delays = ", ".join(number_text(delay.value) for delay in row.settling_delay.values())
        yield f"  {row.kind:<{width}}  {delays} s"
    yield from _diagnosis_lines(found, width)
    for entry in found.unrecovered[:SHOWN]:
        yield f"  case {entry.case}: {entry.text}"
    if len(found.unrecovered) > SHOWN:
        yield f"  and {len(found.unrecovered) - SHOWN} more cases, in the store, --csv and report"


def _diagnosis_lines(found: "RecoverySummary", width: int) -> Iterator[str]:
    """How failures were detected and isolated, and alarms without a failure."""
    told = [(row, row.diagnosis) for row in found.by_kind if row.diagnosis is not None]
    if told:
        yield "diagnosis, by kind of failure (50 % and 90 % of delays to alarm and verdict)"
    for row, one in told:
        late = [
            ", ".join(number_text(value.value, 3) for value in delays.values()) or "-"
            for delays in (one.detection_delay, one.isolation_delay)
        ]
        yield (
            f"  {row.kind:<{width}}  {one.detected} of {row.cases} detected ({late[0]} s), "
            f"{one.isolated} correctly isolated (+ {late[1]} s), {one.as_kind} with the right kind"
        )
    if found.false_alarms is not None:
        hours = fixed_text(found.healthy_time / 3600, 1)
        yield f"false alarms     {found.false_alarms} in {hours} h before any failure"


def _ranking_lines(result: str, ranking: "Sequence[Sensitivity]") -> Iterator[str]:
    """The numbers that matter, and nothing where the result does not vary."""
    if not any(entry.first_order.value == entry.first_order.value for entry in ranking):
        return
    shown = [entry for entry in ranking if entry.matters][:SHOWN]
    if not shown:
        yield f"sensitivity of {result}: no significant dependence with this number of cases"
        return
    yield f"sensitivity of {result}: first-order index and rank correlation (95 % intervals)"
    for entry in shown:
        index, rank = entry.first_order, entry.rank_correlation
        yield (f"  {entry.name:<26} {_indices(index)}  {_indices(rank)}")


def _indices(value: "Interval") -> str:
    found, low, high = (fixed_text(one, 2) for one in value)
    return f"{found} ({low} to {high})"


def progress_text(progress: "StudyProgress") -> str:
    """One line on how far a study is."""
    left = f"{progress.seconds_left:.0f} s left" if progress.seconds_left >= 1 else "finishing"
    return (
        f"{progress.done} of {progress.count} cases, {progress.rate:.1f} per second, "
        f"{left}, {progress.fraction_settled:.1%} settled"
    )
