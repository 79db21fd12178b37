"""Plots painted by matplotlib.

Margins are fixed: measuring text for a layout takes as long as drawing a figure.
"""

import itertools
import re
import textwrap
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, LogFormatterSciNotation
from matplotlib.transforms import ScaledTranslation

from jaxsat.core.text import clean
from jaxsat.report.plot import Axis, Line, Plot, Strips, Timeline, kept_samples, largest_of_parts
from jaxsat.report.shared_ticks import SharedTicksAxes
from jaxsat.report.style import (
    MAX_TITLE_LENGTH,
    SETTINGS,
    STYLES,
    NotebookFigure,
    escape_mathematics,
    line_of,
    set_title,
)
from jaxsat.report.timeline_painter import paint_marks, paint_shades

BARS = "#56B4E9"
DARKEST_BAND = 0.3
"""Opacity of the only band of a panel; several share it."""

FAINT = {"color": "#999999", "linestyle": "-", "linewidth": 0.8, "zorder": 1.5}

WIDTH = 7.0
LEFT, RIGHT, TOP, BOTTOM = 1.25, 0.15, 0.27, 0.45
"""Inches around the panels of a figure."""

BAR = 0.6
"""Inches of the colour bar; all panels of a figure are equally wide."""

TICKS, ROW, GAP = 0.22, 0.17, 0.17
"""Inches of the numbers below a panel, of a line of text above one, and least gap of panels."""

LABEL_AT = 0.77
"""Inches from a panel to the label of its axis; numbers at ticks have this room."""

TITLE_WIDTH, LABEL_WIDTH, LEGEND_WIDTH, HANDLE = 98, 22, 100, 7
"""Characters of a line above a panel, beside one, and in a legend without a bar beside it, and of
the line drawn in a legend entry."""

NAME = 12
"""Characters of the name of a strip."""

LINE_SAMPLES, BAND_SAMPLES, STRIP_PARTS, SHADES = 2400, 4000, 300, 256
"""Samples of a line, three for each pixel, of a line with a band, time intervals of strips, and
shades of a colour bar."""

POWER = re.compile(r"\$\\mathdefault\{(-?)(?:(.+)\\times)?10\^\{(-?\d+)\}\}\$")
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class PowerFormatter(LogFormatterSciNotation):
    """Powers of ten as plain text, 2×10⁻³: mathematics takes ten times as long to set."""

    def __call__(self, x: float | int, pos: int | None = None) -> str:
        """Return the text of the number at a tick."""
        text = super().__call__(x, pos)
        power = POWER.fullmatch(text)
        if power is None:
            return text.replace("$\\mathdefault{", "").replace("}$", "")
        sign, factor, exponent = power.groups()
        return f"{sign and '−'}{f'{factor}×' if factor else ''}10{exponent.translate(RAISED)}"


def paint(
    plots: Sequence[Plot], title: str, height: float = 2.3, timeline: Timeline | None = None
) -> Figure:
    """Paint a panel for each plot below each other, each with `height` inches.

    Panels over the same axis have its numbers below the last of them alone. The marks of the
    `timeline` are shown in all panels, their names in the uppermost, its spans in the uppermost
    without strips, which would cover them.
    """
    shades = timeline.shades if timeline is not None else {}
    shaded = next((place for place, plot in enumerate(plots) if plot.strips is None), None)
    legends = [
        _entries(plot, shades if place == shaded else ()) for place, plot in enumerate(plots)
    ]
    same_axes = [one.x == other.x for one, other in itertools.pairwise(plots)] + [False]
    new_labels = [one.x.label != other.x.label for one, other in itertools.pairwise(plots)] + [True]
    below = [
        0.0 if same else BOTTOM if label else TICKS
        for same, label in zip(same_axes, new_labels, strict=True)
    ]
    right = RIGHT + (BAR if any(plot.strips is not None for plot in plots) else 0)
    room = LEGEND_WIDTH * (WIDTH - LEFT - right) / (WIDTH - LEFT - RIGHT)
    columns = [_columns(legend, room) for legend in legends]
    rows = [-(-len(legend) // count) for legend, count in zip(legends, columns, strict=True)]
    heads = [_head(plot, count) for plot, count in zip(plots, rows, strict=True)]
    whole = TOP + sum(heads) + height * len(plots) + sum(below)
    with rc_context(dict[Any, Any](SETTINGS)):
        figure, axes, top = NotebookFigure(figsize=(WIDTH, whole)), [], whole - TOP
        for head, foot in zip(heads, below, strict=True):
            top -= head + height
            place = (LEFT / WIDTH, top / whole, 1 - (LEFT + right) / WIDTH, height / whole)
            axes.append(figure.add_axes(place, axes_class=SharedTicksAxes))
            top -= foot
        set_title(figure, title, 1 - 0.07 / whole)
        for number, (panel, plot) in enumerate(zip(axes, plots, strict=True)):
            if timeline is not None:
                panel.set_xlim(timeline.times[0], timeline.times[-1])
            _paint(figure, panel, plot)
            if timeline is not None:
                paint_marks(panel, timeline, with_names=not number)
                if number == shaded:
                    paint_shades(panel, timeline)
            if legends[number]:
                _place_legend(panel, legends[number], columns[number], above=not plot.sentence)
            panel.tick_params(labelbottom=not same_axes[number])
            if new_labels[number]:
                panel.set_xlabel(escape_mathematics(plot.x.text))
    return figure


def paint_grid(rows: Sequence[Sequence[Plot | None]], title: str) -> Figure:
    """Paint rows of panels beside each other with one legend; None leaves a place empty.

    A line has the same style in all panels by its label; markers distinguish many lines.
    """
    plots = [plot for row in rows for plot in row if plot is not None]
    names = list(dict.fromkeys(line.label for plot in plots for line in plot.lines))
    size = (max(6.5, 3.2 * len(rows[0]) + 0.8), 2.3 * len(rows) + 1.1)
    with rc_context(dict[Any, Any](SETTINGS)):
        figure = NotebookFigure(figsize=size, layout="constrained")
        panels = figure.subplots(len(rows), len(rows[0]), squeeze=False, sharey=True)
        set_title(figure, title)
    handles = {}
    for row, column in itertools.product(range(len(rows)), range(len(rows[0]))):
        panel, plot = panels[row, column], rows[row][column]
        if plot is None:
            panel.set_visible(False)
            continue
        for line in plot.lines:
            number = names.index(line.label)
            look = line_of(number) | {"markevery": (0.03 * (number % 5), 0.15)}
            look |= {"drawstyle": "steps-post"} if line.steps else {}
            handles[line.label] = panel.plot(line.x, line.y, **look)[0]
        panel.set_title(escape_mathematics(plot.title), fontsize=8, loc="left")
        _scale(panel, plot)
        panel.set_ylabel(escape_mathematics(plot.y.text) if column == 0 else "")
        panel.set_xlabel(escape_mathematics(plot.x.text) if row == len(rows) - 1 else "")
    labels = [*map(escape_mathematics, handles)]
    columns = min(5, _columns(labels))
    figure.legend([*handles.values()], labels, loc="outside lower center", ncols=columns)
    return figure


def _head(plot: Plot, legend_rows: int) -> float:
    """Return the inches above a panel, for a sentence or a legend."""
    return GAP + ROW * (len(_sentences(plot).split("\n")) if plot.sentence else legend_rows)


def _sentences(plot: Plot) -> str:
    return textwrap.fill(clean(f"{plot.title}. {plot.sentence}", MAX_TITLE_LENGTH), TITLE_WIDTH)


def _entries(plot: Plot, shades: Collection[str]) -> list[str]:
    bands = (line.band.label for line in plot.lines if line.band is not None)
    labels = [*(line.label for line in plot.lines), *dict.fromkeys(bands), *shades]
    entries = [escape_mathematics(label) for label in labels if label]
    return entries if len(entries) > 1 or shades else []


def _columns(legend: Sequence[str], room: float = LEGEND_WIDTH) -> int:
    longest = max(map(len, legend), default=0)
    return max(1, min(len(legend), int(room / (longest + HANDLE))))


def _place_legend(panel: Axes, legend: Sequence[str], columns: int, *, above: bool) -> None:
    place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.1}
    handles = dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    entries = {label: handles[label] for label in legend if label in handles}
    place |= {"ncols": columns}
    panel.legend([*entries.values()], [*entries], fontsize=8, **(place if above else {}))


def _paint(figure: Figure, panel: Axes, plot: Plot) -> None:
    if plot.bars is not None:
        edges, heights = plot.bars.edges, plot.bars.heights
        width = edges[1:] - edges[:-1]
        look = {"color": BARS, "edgecolor": "#ffffff", "linewidth": 0.4}
        panel.bar(edges[:-1], heights, width, align="edge", **look)
    bands = sum(line.band is not None for line in plot.lines)
    for number, line in enumerate(plot.lines):
        _paint_line(panel, line, number, plot.y.log, DARKEST_BAND / max(bands, 1))
    _scale(panel, plot)
    panel.set_ylabel(_beside(plot.y), fontsize=8)
    inches = ScaledTranslation(-LABEL_AT, 0, figure.dpi_scale_trans)
    panel.yaxis.set_label_coords(0, 0.5, panel.transAxes + inches)
    if plot.strips is not None:
        _paint_strips(figure, panel, plot.strips)
    if plot.sentence:
        panel.set_title(_sentences(plot), fontsize=8, loc="left", parse_math=False, y=1.0)


def _beside(axis: Axis) -> str:
    """Return the label beside an axis in up to three lines; a long one without a unit in two."""
    unit = f"({'–' if axis.unit == '1' else axis.unit})" if axis.unit else ""
    lines = textwrap.wrap(f"{axis.label} {unit}", LABEL_WIDTH)
    if len(lines) > 3:
        lines = textwrap.wrap(axis.label, LABEL_WIDTH, max_lines=2, placeholder="…")
        lines += [unit] if axis.unit not in ("", "1") else []
    return "\n".join(map(escape_mathematics, lines))


def _scale(panel: Axes, plot: Plot) -> None:
    for axis, quantity, set_scale in (
        (panel.xaxis, plot.x, panel.set_xscale),
        (panel.yaxis, plot.y, panel.set_yscale),
    ):
        if quantity.linear_to is not None:
            set_scale("symlog", linthresh=quantity.linear_to)
            axis.set_major_formatter(PowerFormatter(linthresh=quantity.linear_to))
        elif quantity.log:
            set_scale("log")
            axis.set_major_formatter(PowerFormatter())
            axis.set_minor_formatter(PowerFormatter(labelOnlyBase=False))
        if quantity.names:
            axis.set_ticks([*quantity.names], [*map(escape_mathematics, quantity.names.values())])
    panel.set_xlim(*plot.x.limits)
    panel.set_ylim(*plot.y.limits)


def _paint_line(panel: Axes, line: Line, number: int, log: bool, shade: float) -> None:
    look = dict(FAINT if line.faint else STYLES[number % len(STYLES)])
    band = line.band
    columns = [line.y] if band is None else [line.y, band.low, band.high]
    most = LINE_SAMPLES if band is None else BAND_SAMPLES
    samples = kept_samples(np.stack(columns, axis=1), most)
    x = line.x[samples]
    if band is not None:
        label = escape_mathematics(band.label)
        is_new = label not in panel.get_legend_handles_labels()[1]
        panel.fill_between(
            x,
            band.low[samples],
            band.high[samples],
            step="post" if line.steps else None,
            label=label if label and is_new else "_",
            color=look["color"],
            alpha=shade,
            linewidth=0.4,
        )
    look |= {"drawstyle": "steps-post"} if line.steps else {}
    look |= {"marker": "o", "markersize": 3.5} if line.points else {}
    y = np.where(line.y > 0, line.y, np.nan) if log else line.y
    panel.plot(x, y[samples], label=escape_mathematics(line.label), **look)


def _paint_strips(figure: Figure, panel: Axes, strips: Strips) -> None:
    """Paint a strip in shades of grey for each component, and a bar of the shades.

    Each shade is the largest value of an interval that is wide enough to be seen. Both are images,
    drawn in a tenth of the time of meshes.
    """
    begins, largest = largest_of_parts(strips.values, STRIP_PARTS)
    count, finite = len(strips.labels), largest[np.isfinite(largest)]
    ends = (finite.min(), finite.max()) if len(finite) else (0.0, 1.0)
    low, high = AutoLocator().nonsingular(*ends)
    look: dict[str, Any] = {"cmap": "Greys", "vmin": low, "vmax": high, "zorder": 1.0}
    times, rows = np.append(strips.x[begins], strips.x[-1]), np.arange(count + 1) + 0.5
    panel.pcolorfast(times, rows, largest.T, **look)
    panel.set_ylim(rows[0], rows[-1])
    names = [escape_mathematics(clean(label, NAME)) for label in strips.labels]
    panel.set_yticks(np.arange(1, count + 1), names, fontsize=7)
    panel.grid(visible=False)
    left, bottom, width, height = panel.get_position().bounds
    place = (left + width + 0.1 / WIDTH, bottom, 0.12 / WIDTH, height)
    bar = figure.add_axes(place, axes_class=SharedTicksAxes)
    bar.pcolorfast((0, 1), (low, high), np.linspace(low, high, SHADES)[:, None], **look)
    bar.spines[:].set_visible(True)
    bar.grid(visible=False)
    bar.set_xticks([])
    bar.yaxis.tick_right()
    bar.tick_params(labelsize=7)
