"""Plots painted by matplotlib."""

import textwrap
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxsat.core.text import clean
from jaxsat.report.plot import Plot
from jaxsat.report.style import (
    FURTHER_LINES,
    LINES,
    MAX_TITLE_LENGTH,
    escape_mathematics,
    panels,
)

BAND, BARS = "#a9d6f3", "#56B4E9"
TITLE_WIDTH = 110
"""Characters of a line above a panel."""

FAINT = {"color": "#999999", "linestyle": "-", "linewidth": 0.8, "zorder": 1.5}
STYLES = (*LINES, *FURTHER_LINES)


def paint(plots: Sequence[Plot], title: str, height: float = 2.3) -> Figure:
    """A figure with a panel for each plot below each other, each `height` inches."""
    figure, axes = panels(len(plots), title, height)
    for panel, plot in zip(axes, plots, strict=True):
        _paint(panel, plot)
    figure.align_ylabels(axes)
    return figure


def _paint(panel: Axes, plot: Plot) -> None:
    if plot.bars is not None:
        edges, heights = plot.bars.edges, plot.bars.heights
        width = edges[1:] - edges[:-1]
        look = {"color": BARS, "edgecolor": "#ffffff", "linewidth": 0.4}
        panel.bar(edges[:-1], heights, width, align="edge", **look)
    if plot.band is not None:
        first = plot.lines[0]
        step = "post" if first.steps else None
        ends = (plot.band.low, plot.band.high)
        panel.fill_between(first.x, *ends, step=step, color=BAND, linewidth=0)
    for number, line in enumerate(plot.lines):
        look = dict(FAINT if line.faint else STYLES[number % len(STYLES)])
        look |= {"drawstyle": "steps-post"} if line.steps else {}
        look |= {"marker": "o", "markersize": 3.5} if line.points else {}
        panel.plot(line.x, line.y, label=escape_mathematics(line.label), **look)
    if sum(bool(line.label) for line in plot.lines) > 1:
        panel.legend(fontsize=8)
    panel.set_xscale("log" if plot.x.log else "linear")
    panel.set_yscale("log" if plot.y.log else "linear")
    panel.set_xlim(*plot.x.limits)
    panel.set_ylim(*plot.y.limits)
    panel.set_xlabel(escape_mathematics(plot.x.text))
    panel.set_ylabel(escape_mathematics(plot.y.text))
    told = textwrap.fill(clean(f"{plot.title}. {plot.told}", MAX_TITLE_LENGTH), TITLE_WIDTH)
    panel.set_title(told, fontsize=8, loc="left", parse_math=False)
