"""Plots painted by Bokeh, in one style; models that follow the colours of the page carry a tag."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import (
    BoxZoomTool,
    ColumnDataSource,
    CrosshairTool,
    DataRange1d,
    HoverTool,
    LinearAxis,
    LinearColorMapper,
    PrintfTickFormatter,
    Range1d,
    RangeTool,
    Span,
)
from bokeh.palettes import cividis
from bokeh.plotting import figure

from jaxsat.core.text import number_text
from jaxsat.report.document import Chart, LegendKey
from jaxsat.report.plot import (
    Axis,
    Bars,
    Line,
    Plot,
    Strips,
    Timeline,
    kept_samples,
    largest_of_parts,
)
from jaxsat.report.style import MOST_LINES, STYLES

HEIGHT, HEIGHT_OVER_TIME = 260, 190
BLUE = "#56B4E9"
FAINT: dict[str, Any] = {"line_color": "#999999", "line_width": 0.8}
FORM = "{%.5g}"

STRIP_PARTS = 800
"""Number of time intervals of strips."""

INK, INK_TEXT, INK_GRID, INK_FILL = "ink", "ink-text", "ink-grid", "ink-fill"
"""Tags of models whose line, text, grid or area is black on white and light on dark."""
INKS = (INK, INK_TEXT, INK_GRID, INK_FILL)


class TimeWindow:
    """Time window that plots share: they are enlarged together, with one cursor and the marks."""

    def __init__(self, timeline: Timeline):
        start, end = float(timeline.times[0]), float(timeline.times[-1])
        self.range = Range1d(
            start=start, end=end, bounds=(start, end), min_interval=(end - start) * 1e-6
        )
        self.reset = (start, end)
        self.cursor = Span(dimension="height", location=None, line_width=1.5, line_color="#CC3311")
        self.cursor.tags = ["cursor"]
        self._hair = Span(dimension="height", line_dash="dotted", line_width=1, tags=[INK])
        self._marks = [at for at, _ in timeline.marks]

    def join(self, plot: Any) -> None:
        """Give a Bokeh figure the marks, the cursor, and a line that follows the pointer."""
        for instant in self._marks:
            look = {"dimension": "height", "line_dash": "dashed", "tags": [INK]}
            plot.add_layout(Span(location=instant, **look))
        plot.add_layout(self.cursor)
        plot.tools = [*plot.tools, CrosshairTool(overlay=self._hair, dimensions="height")]


def chart_of(plot: Plot, window: TimeWindow | None = None) -> Chart:
    """Return the plot with a tooltip for the nearest point; one over time in its window."""
    axes = (("x", plot.x), ("y", plot.y))
    options: dict[str, Any] = {f"{name}_axis_type": "log" for name, axis in axes if axis.log}
    if window is None:
        options |= {"x_label": plot.x.text, "y_label": plot.y.text, "height": HEIGHT}
    else:
        unit = "degrees" if plot.y.unit == "°" else plot.y.unit_text
        options |= {"x_label": plot.x.text, "y_label": unit, "height": HEIGHT_OVER_TIME}
        options |= {"x_range": window.range, "y_range": DataRange1d(range_padding=0.08)}
    if plot.strips is not None:
        options |= {"y_range": list(map(plain, plot.strips.labels)), "y_label": ""}
    drawing = _figure(**options)
    ranges = {"y": drawing.y_range} | ({"x": drawing.x_range} if window is None else {})
    for name, axis in axes:
        ends = zip(("start", "end"), axis.limits, strict=True)
        if name in ranges:
            ranges[name].update(**{end: value for end, value in ends if value is not None})
    if plot.y.names:
        drawing.yaxis.ticker = [*plot.y.names]
        drawing.yaxis.major_label_overrides = dict(plot.y.names)
    title = plot.title
    if plot.bars is not None:
        _bars(drawing, plot, plot.bars)
    if plot.strips is not None:
        title = f"{title}, {_strips(drawing, plot, plot.strips)}".rstrip()
    _lines(drawing, plot)
    if window is not None:
        window.join(drawing)
    return Chart(
        drawing, title, f"{plot.title}. {plot.sentence or _description(plot)}", _keys(plot)
    )


def overview_of(plot: Plot, window: TimeWindow) -> Chart:
    """Return the first line over the whole time; the box in it is the window of all other plots."""
    (start, end), line = window.reset, plot.lines[0]
    samples = kept_samples(line.y[:, None], 1500)
    drawing = _figure(x_range=Range1d(start=start, end=end), height=80)
    drawing.line(line.x[samples], line.y[samples].astype("f4"), **stroke_of(2))
    drawing.yaxis.visible = False
    drawing.ygrid.visible = False
    tool = RangeTool(x_range=window.range, start_gesture="pan")
    tool.overlay.fill_color = BLUE
    tool.overlay.fill_alpha = 0.2
    drawing.tools = [tool]
    drawing.add_layout(window.cursor)
    title = f"{plot.title} over the whole run; drag in here to choose the window"
    description = f"{plot.title} over the whole time, in which a window of time can be chosen."
    return Chart(drawing, title, description)


def stroke_of(number: int) -> dict[str, Any]:
    """Return colour, dashes and width of a line, as in the figures on paper."""
    style = STYLES[number % MOST_LINES]
    dash = style["linestyle"]
    return {
        "line_color": style["color"],
        "line_dash": "solid" if dash == "-" else [max(1, round(3 * part / 2)) for part in dash[1]],
        "line_width": max(1.4, 1.3 * style["linewidth"]),
    }


def plain(text: str) -> str:
    """Protect a label from being taken for mathematics, for which Bokeh would load a library."""
    for mark in ("$$", "\\[", "\\("):
        text = text.replace(mark, mark[0] + "\u2060" + mark[1])
    return text


def _figure(*, x_label: str = "", y_label: str = "", x_range: Any = None, **options: Any) -> Any:
    """Return an empty figure without title; dragging zooms, the wheel scrolls the page."""
    drag = BoxZoomTool(dimensions="width") if x_range is not None else BoxZoomTool()
    drawing = figure(
        sizing_mode="stretch_width",
        toolbar_location=None,
        x_axis_label=plain(x_label) or None,
        y_axis_label=plain(y_label) or None,
        tools=[drag],
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        min_border_left=78,
        output_backend="canvas",
        **({} if x_range is None else {"x_range": x_range, "window_axis": "x"}),
        **options,
    )
    drawing.toolbar.active_drag = drag
    for axis in drawing.axis:
        if isinstance(axis, LinearAxis):
            axis.update(formatter=PrintfTickFormatter(format="%.9g"))
        axis.tags = [INK, INK_TEXT]
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = "12px"
        axis.major_label_text_font_size = "12px"
    for grid in drawing.grid:
        grid.tags = [INK_GRID]
    return drawing


def _keys(plot: Plot) -> list[LegendKey]:
    if sum(bool(line.label) for line in plot.lines) < 2:
        return []
    lines = [line for line in plot.lines if not line.faint]
    faint = [line.label for line in plot.lines if line.faint and line.label]
    keys = [_key(line.label, stroke_of(number)) for number, line in enumerate(lines)]
    return keys + [_key(label, FAINT) for label in faint]


def _key(label: str, stroke: Mapping[str, Any]) -> LegendKey:
    color, dash = stroke["line_color"], stroke.get("line_dash", "solid")
    color = "currentColor" if color == "#000000" else color
    dashes = "" if dash == "solid" else " ".join(map(str, dash))
    return LegendKey(label, color, dashes, stroke["line_width"])


def _lines(drawing: Any, plot: Plot) -> None:
    """Draw lines; those over the same points share a tooltip, others have one each."""
    for line in plot.lines:
        if line.faint:
            drawing.line(line.x, _drawable(line.y, plot.y), **FAINT)
    lines = [line for line in plot.lines if not line.faint]
    if lines and all(line.x is lines[0].x for line in lines):
        _group(drawing, plot, lines, 0)
    else:
        for number, line in enumerate(lines):
            _group(drawing, plot, [line], number)


def _group(drawing: Any, plot: Plot, lines: Sequence[Line], first: int) -> None:
    """Draw lines over the same points, with bands; `first` is the first one's index."""
    columns = {}
    for number, line in enumerate(lines):
        columns[f"y{number}"] = line.y
        if line.band is not None:
            columns |= {f"low{number}": line.band.low, f"high{number}": line.band.high}
    samples = kept_samples(np.stack([*columns.values()], axis=1).astype(float))
    data: dict[str, Any] = {
        name: _drawable(column[samples], plot.y).astype("f4") for name, column in columns.items()
    }
    source = ColumnDataSource({"x": lines[0].x[samples], **data})
    rows, renderers = [(plot.x.label, _value_text("x", plot.x))], []
    for number, line in enumerate(lines):
        stroke, ends = stroke_of(first + number), (f"low{number}", f"high{number}")
        if line.band is not None:
            _band(drawing, line, ends, stroke["line_color"], source)
        renderers.append(_line(drawing, line, f"y{number}", stroke, source))
        rows.append((line.label or plot.y.label, _value_text(f"y{number}", plot.y)))
        if line.band is not None:
            low, high = (_value_text(end, plot.y) for end in ends)
            rows.append((line.band.label or "range", f"{low} to {high}"))
    together = len(lines) > 1 or lines[0].band is not None or len(plot.lines) == 1
    _hover(drawing, renderers[0], rows, "vline" if together else "mouse")


def _band(
    drawing: Any, line: Line, ends: tuple[str, str], color: str, source: ColumnDataSource
) -> None:
    look = {"fill_color": color, "fill_alpha": 0.25, "source": source}
    if line.steps:
        area = drawing.varea_step("x", *ends, step_mode="after", **look)
    else:
        area = drawing.varea("x", *ends, **look)
    area.glyph.tags = [INK_FILL] if color == "#000000" else []


def _line(
    drawing: Any, line: Line, column: str, stroke: Mapping[str, Any], source: ColumnDataSource
) -> Any:
    mode: dict[str, Any] = {"mode": "after"} if line.steps else {}
    draw = drawing.step if line.steps else drawing.line
    renderer = draw("x", column, source=source, **stroke, **mode)
    ink = stroke["line_color"] == "#000000"
    renderer.glyph.tags = [INK] if ink else []
    if line.points:
        color = {"fill_color": stroke["line_color"], "line_color": None}
        dots = drawing.scatter("x", column, source=source, size=6, **color)
        dots.glyph.tags = [INK_FILL] if ink else []
    return renderer


def _bars(drawing: Any, plot: Plot, bars: Bars) -> None:
    edges: dict[str, Any] = {"left": bars.edges[:-1], "right": bars.edges[1:], "top": bars.heights}
    source, names = ColumnDataSource(edges), {name: name for name in edges}
    look: dict[str, Any] = {"fill_color": BLUE, "line_color": None}
    renderer = drawing.quad(bottom=0, source=source, **names, **look)
    over = f"{_value_text('left', Axis(''))} to {_value_text('right', plot.x)}"
    _hover(drawing, renderer, [(plot.x.label, over), (plot.y.label, "@top{%d}")], "vline")


def _strips(drawing: Any, plot: Plot, strips: Strips) -> str:
    """Draw strips of shades, darker is smaller; return the meaning of the shades."""
    shades = largest_of_parts(strips.values, STRIP_PARTS)[1].astype("f4").T
    start, end = float(strips.x[0]), float(strips.x[-1])
    finite = strips.values[np.isfinite(strips.values)]
    ends = np.array([finite.min(), finite.max()]) if finite.size else np.array([0.0, 1.0])
    low, top = map(float, np.where(np.abs(ends) < 1e-9 * np.abs(ends).max(), 0.0, ends))
    mapper = LinearColorMapper(palette=cividis(64), low=low, high=top if top > low else low + 1)
    mapper.nan_color = "rgba(0, 0, 0, 0)"
    count = len(strips.labels)
    renderer = drawing.image([shades], start, 0, end - start, count, color_mapper=mapper)
    drawing.height = max(HEIGHT_OVER_TIME, 18 * count + 40)
    _hover(
        drawing,
        renderer,
        [("t", "$x{%.6g} s"), (plot.title, _value_text("image", plot.y))],
        "mouse",
    )
    least, most = (number_text(end, 3) for end in (low, top))
    unit = plot.y.unit_text
    if least == most:
        return f"{least} all the time {unit}"
    return f"from {least} (dark) to {most} (bright) {unit}"


def _drawable(values: np.ndarray, axis: Axis) -> np.ndarray:
    """Replace values that a logarithmic axis cannot show by NaN."""
    return np.where(values > 0, values, np.nan) if axis.log else np.asarray(values)


def _value_text(column: str, axis: Axis) -> str:
    return f"@{column}{FORM} {axis.unit_text}".rstrip()


def _hover(drawing: Any, renderer: Any, rows: Sequence[tuple[str, str]], mode: Any) -> None:
    """Add the tooltip of the nearest point, every number printed as C does."""
    tooltips = [(plain(label), text) for label, text in rows]
    columns = {
        word.partition("{")[0] for _, text in tooltips for word in text.split() if "{" in word
    }
    formats: Any = dict.fromkeys(columns, "printf")
    hover = HoverTool(renderers=[renderer], mode=mode, tooltips=tooltips, formatters=formats)
    drawing.tools = [*drawing.tools, hover]


def _description(plot: Plot) -> str:
    columns = [(line.label, line.y) for line in plot.lines if not line.faint]
    if plot.strips is not None:
        columns = [*zip(plot.strips.labels, plot.strips.values.T, strict=True)]
    parts = []
    for label, column in columns:
        good = column[np.isfinite(column)]
        if len(good):
            size = float(np.abs(good).max())
            least, most, last = (
                number_text(one, 3, scale=size) for one in (good.min(), good.max(), good[-1])
            )
            clause = f"from {least} to {most}, at the end {last} {plot.y.unit_text}".rstrip()
            parts.append(f"{label or plot.y.label}: {clause}")
    return "; ".join(parts) + "." if parts else "No values."
