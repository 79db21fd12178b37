"""Events of a timeline, painted by matplotlib over a panel of signals."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg

from jaxsat.report.plot import Timeline
from jaxsat.report.style import escape_mathematics

MARK_ROWS, MARK_STEP = 9, 0.1
"""Rows of names of instants, and the height of one over that of a panel."""


def paint_marks(panel: Axes, timeline: Timeline, *, with_names: bool) -> None:
    """Paint dotted lines at the instants, as one object, with their names if `with_names`."""
    if not timeline.marks:
        return
    instants = [at for at, _ in timeline.marks]
    across, along = np.repeat(instants, 3), np.tile([0.0, 1.0, np.nan], len(instants))
    where = {"transform": panel.get_xaxis_transform(), "scalex": False, "scaley": False}
    panel.plot(across, along, color="black", linewidth=0.9, linestyle=(0, (1, 1.5)), **where)
    if with_names:
        _name_marks(panel, timeline)


def paint_shades(panel: Axes, timeline: Timeline) -> None:
    """Paint bands of grey during the named spans of time, from their first to last samples."""
    greys = np.linspace(0.7, 0.9, max(len(timeline.shades), 1))
    for grey, (name, there) in zip(greys, timeline.shades.items(), strict=False):
        changes = np.flatnonzero(there[1:] != there[:-1])
        ends = np.unique(np.concatenate([[0], changes, changes + 1, [len(there) - 1]]))
        panel.fill_between(
            timeline.times[ends],
            0,
            1,
            where=list(there[ends]),
            transform=panel.get_xaxis_transform(),
            color=str(grey),
            linewidth=0,
            zorder=0.5,
            step="post",
            label=escape_mathematics(name),
        )


def _name_marks(panel: Axes, timeline: Timeline) -> None:
    """Write the names of the marks, each in the first row without overlap.

    A name is right of its mark, or left of it where it would leave the panel.
    """
    occupied: list[list[tuple[float, float]]] = [[] for _ in range(MARK_ROWS)]
    measuring = RendererAgg(1, 1, panel.figure.dpi)
    for at, name in timeline.marks:
        if not name:
            continue
        text = panel.text(
            at,
            0.0,
            f" {escape_mathematics(name)} ",
            transform=panel.get_xaxis_transform(),
            verticalalignment="top",
            fontsize="small",
            clip_on=True,
            bbox={"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1},
        )
        span = text.get_window_extent(measuring)
        begin, end, edge = span.x0, span.x1, panel.get_window_extent()
        if end > edge.x1 and begin - span.width > edge.x0:
            text.set_horizontalalignment("right")
            begin, end = begin - span.width, begin
        free = (
            row
            for row, others in enumerate(occupied)
            if all(end <= left or begin >= right for left, right in others)
        )
        row = next(free, MARK_ROWS - 1)
        occupied[row].append((begin, end))
        text.set_y(0.97 - MARK_STEP * row)
