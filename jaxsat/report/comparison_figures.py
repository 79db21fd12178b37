"""Figures of a comparison of laws: settling times, and recoveries from failures."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jaxsat.report.figure_painter import paint_grid
from jaxsat.report.study_plots import settled_by_law
from jaxsat.report.style import escape_mathematics, line_of, panels


def settling_comparison(
    panels: Mapping[tuple[str, float | None], Mapping[str, np.ndarray]],
    horizons: Mapping[tuple[str, float | None], float],
    title: str,
) -> Figure:
    """Plot the fraction settled within a time, a line for each law.

    `panels` has settling times (s, infinite if never) by law, under a level of dispersions and a
    torque limit (N m) or None: a column for each level and a row for each limit. `horizons` (s) end
    the time axes.
    """
    levels = list(dict.fromkeys(level for level, _ in panels))
    limits = list(dict.fromkeys(limit for _, limit in panels))
    plots = {}
    for (level, limit), laws in panels.items():
        panel_title = level if limit is None else f"{level}, {limit:g} N m"
        plots[level, limit] = settled_by_law(panel_title, laws, horizons[level, limit])
    return paint_grid([[plots.get((one, limit)) for one in levels] for limit in limits], title)


def recovery_comparison(recovery: Mapping[str, Mapping[str, Any]], title: str) -> Figure:
    """Plot the recovered fraction of each kind of failure under each law, with 95 % intervals.

    `recovery` has by law and kind `cases` and `fraction`, a mapping of `value`, `low` and `high`.
    """
    kinds = {kind: one["cases"] for of_law in recovery.values() for kind, one in of_law.items()}
    names = list(kinds)
    figure, ((axis,),) = panels(title, (max(6.5, 1.1 * len(kinds) + 1), 3.2))
    for place, (law, of_law) in enumerate(recovery.items()):
        shares = [one["fraction"] for one in of_law.values()]
        value, low, high = (np.array([one[k] for one in shares]) for k in ("value", "low", "high"))
        at = np.array([names.index(kind) for kind in of_law]) + 0.5 * (
            (place + 0.5) / len(recovery) - 0.5
        )
        style: dict[str, Any] = line_of(place) | {"linestyle": "none"}
        ends = np.maximum([value - low, high - value], 0.0)
        axis.errorbar(at, value, ends, capsize=3, label=escape_mathematics(law), **style)
    axis.set_xticks(range(len(kinds)), [f"{kind}\n({n} cases)" for kind, n in kinds.items()])
    axis.set_ylim(-0.03, 1.03)
    axis.set_ylabel("fraction recovered")
    figure.legend(loc="outside lower center", ncols=min(5, len(recovery)))
    return figure
