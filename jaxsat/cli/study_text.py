"""Studies in words: how far one is, and what it found."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jaxsat.montecarlo import StudyProgress, Summary

SHOWN = 8
"""Entries of a sensitivity ranking that are printed."""


def summary_lines(summary: "Summary") -> list[str]:
    """What a study found, for a person."""
    settled = summary.settled
    lines = [
        f"cases            {summary.cases}: "
        + ", ".join(f"{number} {name}" for name, number in summary.outcomes.items()),
        f"settled          {settled.value:.2%} (95 % interval {settled.low:.2%} to "
        f"{settled.high:.2%})",
    ]
    for name, unit in (("settling_time", "s"), ("effort", "N m s")):
        parts = [
            f"{percent:g} %: {found.value:.4g} ({found.low:.4g} to {found.high:.4g})"
            for percent, found in getattr(summary, name).items()
        ]
        if parts:
            lines.append(f"{name.replace('_', ' '):<16} {', '.join(parts)} {unit}")
    lines.append(f"worst cases      {', '.join(map(str, summary.worst))} (see --case)")
    rankings = {"the cost": summary.cost_sensitivity, "settling": summary.settling_sensitivity}
    for result, ranking in rankings.items():
        ranked = [entry for entry in ranking if entry.first_order > 0][:SHOWN]
        shown = [f"{e.name} {e.first_order:.2f} ({e.rank_correlation:+.2f})" for e in ranked]
        if shown:
            found = ", ".join(shown)
            lines.append(f"what {result} depends on: {found}, first-order index (rank correlation)")
    return lines


def progress_text(progress: "StudyProgress") -> str:
    """One line on how far a study is."""
    left = progress.seconds_left
    return (
        f"{progress.done} of {progress.count} cases, {progress.rate:.1f} a second, "
        f"{left:.0f} s left, {progress.fraction_settled:.1%} settled"
    )
