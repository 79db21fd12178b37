"""Plots painted by Bokeh."""

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from jaxsat.report.document import Chart, Key
from jaxsat.report.page.charts import INK, INK_FILL, key_of, new_figure, plain, stroke_of
from jaxsat.report.page.decimation import kept_samples
from jaxsat.report.plot import Axis, Bars, Line, Plot

HEIGHT, BLUE = 260, "#56B4E9"
FAINT: dict[str, Any] = {"line_color": "#999999", "line_width": 0.8}
FORM = "{%.5g}"


def chart_of(plot: Plot) -> Chart:
    """The plot with what a pointer is told of the nearest point."""
    scales = {
        f"{name}_axis_type": "log" for name, axis in (("x", plot.x), ("y", plot.y)) if axis.log
    }
    made = new_figure(x_label=plot.x.text, y_label=plot.y.text, height=HEIGHT, **scales)
    for axis, shown in ((plot.x, made.x_range), (plot.y, made.y_range)):
        ends = zip(("start", "end"), axis.limits, strict=True)
        shown.update(**{end: value for end, value in ends if value is not None})
    if plot.bars is not None:
        _bars(made, plot, plot.bars)
    for line in plot.lines:
        if line.faint:
            made.line(line.x, _drawable(line.y, plot.y), **FAINT)
    for number, line in enumerate(line for line in plot.lines if not line.faint):
        _line(made, plot, line, number)
    return Chart(made, plot.title, f"{plot.title}. {plot.told}", _keys(plot))


def _keys(plot: Plot) -> list[Key]:
    """What the lines are; nothing for a single one."""
    if sum(bool(line.label) for line in plot.lines) < 2:
        return []
    keys = [key_of(number, line.label) for number, line in enumerate(plot.lines) if not line.faint]
    faint = [line.label for line in plot.lines if line.faint and line.label]
    return keys + [Key(label, FAINT["line_color"], "", FAINT["line_width"]) for label in faint]


def _bars(made: Any, plot: Plot, bars: Bars) -> None:
    data: dict[str, Any] = {
        "left": bars.edges[:-1],
        "right": bars.edges[1:],
        "top": bars.heights,
    }
    drawn = made.quad(
        left="left",
        right="right",
        top="top",
        bottom=0,
        source=ColumnDataSource(data),
        fill_color=BLUE,
        line_color=None,
    )
    over = f"@left{FORM} to @right{FORM} {plot.x.unit}"
    _hover(made, drawn, [(plot.x.label, over), (plot.y.label, "@top{%d}")], "vline")


def _line(made: Any, plot: Plot, line: Line, number: int) -> None:
    """A line, its points, and for the first one the band."""
    banded = plot.band is not None and number == 0
    kept = slice(None) if banded else kept_samples(line.y[:, None])
    data: dict[str, Any] = {"x": line.x[kept], "y": _drawable(line.y[kept], plot.y)}
    rows = [(line.label, _at("y", plot.y)), (plot.x.label, _at("x", plot.x))]
    if banded and plot.band is not None:
        data |= {"low": plot.band.low, "high": plot.band.high}
        rows.append(("range", f"@low{FORM} to {_at('high', plot.y)}"))
    source, stroke = ColumnDataSource(data), stroke_of(number)
    mode: dict[str, Any] = {"mode": "after"} if line.steps else {}
    if banded:
        area = {"fill_color": BLUE, "fill_alpha": 0.4, "source": source}
        if line.steps:
            made.varea_step("x", "low", "high", step_mode="after", **area)
        else:
            made.varea("x", "low", "high", **area)
    drawn = (made.step if line.steps else made.line)("x", "y", source=source, **stroke, **mode)
    ink = stroke["line_color"] == "#000000"
    drawn.glyph.tags = [INK] if ink else []
    if line.points:
        color = {"fill_color": stroke["line_color"], "line_color": None}
        dots = made.scatter("x", "y", source=source, size=6, **color)
        dots.glyph.tags = [INK_FILL] if ink else []
    _hover(made, drawn, rows, "vline" if banded else "mouse")


def _drawable(values: np.ndarray, axis: Axis) -> np.ndarray:
    """Without what a logarithmic axis cannot show."""
    return np.where(values > 0, values, np.nan) if axis.log else values


def _at(column: str, axis: Axis) -> str:
    unit = "" if axis.unit == "1" else axis.unit
    return f"@{column}{FORM} {unit}".rstrip()


def _hover(made: Any, drawn: Any, rows: list[tuple[str, str]], mode: Any) -> None:
    """What a pointer is told of the nearest point."""
    keys = ("x", "y", "low", "high", "left", "right", "top")
    printed: Any = {f"@{key}": "printf" for key in keys}
    told = [(plain(label), text) for label, text in rows]
    hover = HoverTool(renderers=[drawn], mode=mode, tooltips=told, formatters=printed)
    made.tools = [*made.tools, hover]
