"""Figure of a family of spacecraft: designs in, a matplotlib `Figure` out."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from jaxsat.report.style import MARKERS, SETTINGS, STYLES, escape_mathematics

LEAST_SHOWN = 5e-4
"""Fraction unsettled at which those with none are drawn."""


def family_figure(rows: Sequence[Mapping[str, Any]], wanted: float) -> Figure:
    """The fraction that does not settle, spacecraft sorted by it, with its interval.

    Rows have `settled`, `low`, `high`, `law` and `limit`, the change that helps most or "". The
    upper panel is by law, the lower one, of those below the `wanted` fraction, by that change.
    """
    ordered = sorted(rows, key=lambda row: (row["settled"], row["low"]))
    with rc_context(dict[Any, Any](SETTINGS)):
        figure = Figure(figsize=(7.0, 5.6), layout="constrained")
        upper, lower = figure.subplots(2, 1)
    _draw(upper, ordered, "law", wanted)
    upper.set_title("by law", fontsize=8, loc="left")
    failing = [row for row in ordered if row["settled"] < wanted]
    named = [{**row, "limit": row["limit"] or "none of the remedies"} for row in failing]
    _draw(lower, named, "limit", wanted)
    lower.set_title(
        "those below the required fraction, by most effective remedy", fontsize=8, loc="left"
    )
    lower.set_xlabel("spacecraft, sorted")
    lower.xaxis.get_major_locator().set_params(integer=True)
    return figure


def _draw(axis: Any, rows: Sequence[Mapping[str, Any]], key: str, wanted: float) -> None:
    names = sorted({row[key] for row in rows}, key=lambda name: -sum(r[key] == name for r in rows))
    for number, name in enumerate(names):
        places = np.array([i for i, row in enumerate(rows) if row[key] == name])
        value, low, high = (
            1 - np.array([rows[i][end] for i in places]) for end in ("settled", "low", "high")
        )
        shown = np.maximum(value, LEAST_SHOWN)
        ends = [shown - np.maximum(high, LEAST_SHOWN), np.maximum(low, LEAST_SHOWN) - shown]
        style = STYLES[number % len(STYLES)]
        axis.errorbar(
            places,
            shown,
            yerr=np.maximum(ends, 0.0),
            fmt=MARKERS[number % len(MARKERS)],
            color=style["color"],
            markersize=3,
            linewidth=0.6,
            label=f"{escape_mathematics(name)} ({len(places)})",
        )
    axis.axhline(1 - wanted, color="#777777", linewidth=0.8, linestyle=(0, (4, 2)))
    axis.set_yscale("log")
    axis.set_ylabel("fraction unsettled")
    if names:
        axis.legend(fontsize=7, loc="upper right")
