"""Figures of a comparison of laws: settling times, and what recovered; matplotlib `Figure`s out."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from jaxsat.report.style import SETTINGS, escape_mathematics, line_of, set_title

EARLIEST = 10.0
"""Seconds at which the logarithmic time axes begin; nothing that tumbles settles before."""

LEGEND_WIDTH, LEGEND_HANDLE = 105, 8
"""Of the legend, and of a line in it, in characters."""


def settling_comparison(
    panels: Mapping[tuple[str, float | None], Mapping[str, np.ndarray]],
    horizons: Mapping[tuple[str, float | None], float],
    title: str,
) -> Figure:
    """The fraction settled within a time, a line for each law.

    `panels` has settling times (s, infinite if never) by law, under a level of dispersions and a
    torque limit (N m), if there is one: a column for each level and a row for each limit.
    `horizons` (s) end the time axes.
    """
    levels = list(dict.fromkeys(level for level, _ in panels))
    limits = list(dict.fromkeys(limit for _, limit in panels))
    names = list(dict.fromkeys(name for laws in panels.values() for name in laws))
    with rc_context(dict[Any, Any](SETTINGS)):
        size = (max(6.5, 3.2 * len(levels) + 0.8), 2.3 * len(limits) + 1.1)
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(limits), len(levels), squeeze=False, sharey=True)
        set_title(figure, title)
    for (level, limit), laws in panels.items():
        axis = axes[limits.index(limit), levels.index(level)]
        for law, times in laws.items():
            steps, number = _fraction_by(times, horizons[level, limit]), names.index(law)
            style = line_of(number) | {"markevery": (0.03 * (number % 5), 0.15)}
            axis.step(*steps, where="post", label=escape_mathematics(law), **style)
        told = level if limit is None else f"{level}, {limit:g} N m"
        axis.set_title(escape_mathematics(told), fontsize=8, loc="left")
        axis.set_xscale("log")
        axis.set_xlim(EARLIEST, horizons[level, limit])
        axis.set_ylim(-0.03, 1.03)
    for row in axes:
        row[0].set_ylabel("fraction settled")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)")
    drawn = [zip(*axis.get_legend_handles_labels(), strict=True) for axis in axes.flat]
    lines = {label: handle for pairs in drawn for handle, label in pairs}
    fitting = LEGEND_WIDTH // (max(map(len, lines)) + LEGEND_HANDLE)
    columns = max(1, min(5, len(lines), fitting))
    figure.legend([*lines.values()], [*lines], loc="outside lower center", ncols=columns)
    return figure


def recovery_comparison(found: Mapping[str, Mapping[str, Any]], title: str) -> Figure:
    """The recovered fraction of each kind of failure under each law, with 95 % intervals.

    `found` has by law and kind `cases` and `fraction`, a mapping of `value`, `low` and `high`.
    """
    kinds = {kind: one["cases"] for of_law in found.values() for kind, one in of_law.items()}
    names = list(kinds)
    with rc_context(dict[Any, Any](SETTINGS)):
        figure = Figure(figsize=(max(6.5, 1.1 * len(kinds) + 1), 3.2), layout="constrained")
        axis = figure.subplots()
        set_title(figure, title)
    for place, (law, of_law) in enumerate(found.items()):
        shares = [one["fraction"] for one in of_law.values()]
        value, low, high = (np.array([one[k] for one in shares]) for k in ("value", "low", "high"))
        at = np.array([names.index(kind) for kind in of_law]) + 0.5 * (
            (place + 0.5) / len(found) - 0.5
        )
        style: dict[str, Any] = line_of(place) | {"linestyle": "none"}
        ends = np.maximum([value - low, high - value], 0.0)
        axis.errorbar(at, value, ends, capsize=3, label=escape_mathematics(law), **style)
    axis.set_xticks(range(len(kinds)), [f"{kind}\n({n} cases)" for kind, n in kinds.items()])
    axis.set_ylim(-0.03, 1.03)
    axis.set_ylabel("fraction recovered")
    figure.legend(loc="outside lower center", ncols=min(5, len(found)))
    return figure


def _fraction_by(times: np.ndarray, end: float) -> tuple[np.ndarray, np.ndarray]:
    settled = np.sort(times[np.isfinite(times)])
    share = np.arange(len(settled) + 1) / len(times)
    return np.concatenate([[EARLIEST], settled, [end]]), np.concatenate([share, share[-1:]])
