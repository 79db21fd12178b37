"""Bokeh figures in one style; models that follow the colours of the page carry a tag."""

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

from jaxsat.core.numerals import number_text
from jaxsat.report.document import Chart, Key
from jaxsat.report.page.decimation import kept_samples
from jaxsat.report.style import FURTHER_LINES, LINES

STYLES = (*LINES, *FURTHER_LINES)
MOST_LINES = len(STYLES)
"""Lines that can be told apart; more signals are drawn as strips."""

HEIGHT = 190
INK, INK_TEXT, INK_GRID, INK_FILL = "ink", "ink-text", "ink-grid", "ink-fill"
"""Tags of models whose line, text, grid or area is black on white and light on dark."""
INKS = (INK, INK_TEXT, INK_GRID, INK_FILL)


def _dash(style: Mapping[str, Any]) -> Any:
    dash = style["linestyle"]
    return "solid" if dash == "-" else [max(1, round(3 * part / 2)) for part in dash[1]]


def stroke_of(number: int) -> dict[str, Any]:
    """Colour, dashes and width of a line, as in the figures on paper."""
    style = STYLES[number % MOST_LINES]
    width = max(1.4, 1.3 * style["linewidth"])
    return {"line_color": style["color"], "line_dash": _dash(style), "line_width": width}


def legend(labels: Sequence[str]) -> list[Key]:
    """What the lines of a plot are, in the order of their styles; nothing for a single one."""
    return [key_of(*one) for one in enumerate(labels)] if len(labels) > 1 else []


def key_of(number: int, label: str) -> Key:
    """What a line is in a legend."""
    stroke = stroke_of(number)
    color, dash = stroke["line_color"], stroke["line_dash"]
    return Key(
        label,
        "currentColor" if color == "#000000" else color,
        " ".join(map(str, dash)) if dash != "solid" else "",
        stroke["line_width"],
    )


def plain(text: str) -> str:
    """A label that is never taken for mathematics, for which Bokeh would load a library."""
    for mark in ("$$", "\\[", "\\("):
        text = text.replace(mark, mark[0] + "\u2060" + mark[1])
    return text


def new_figure(*, x_label: str = "", y_label: str = "", x_range: Any = None, **options: Any) -> Any:
    """An empty figure without a title, which the page has; dragging enlarges, no wheel is taken."""
    drag = BoxZoomTool(dimensions="width") if x_range is not None else BoxZoomTool()
    made = figure(
        height=options.pop("height", HEIGHT),
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
        **({} if x_range is None else {"x_range": x_range}),
        **options,
    )
    made.toolbar.active_drag = drag
    for axis in made.axis:
        if isinstance(axis, LinearAxis):
            axis.update(formatter=PrintfTickFormatter(format="%.9g"))
        axis.tags = [INK, INK_TEXT]
        axis.axis_label_text_font_style = "normal"
        axis.axis_label_text_font_size = "12px"
        axis.major_label_text_font_size = "12px"
    for grid in made.grid:
        grid.tags = [INK_GRID]
    return made


class TimePlots:
    """Plots over one time axis: they are enlarged together and share cursor and marks.

    `times` (s) are those of all signals; `marks` are instants (s) and what happens then.
    """

    def __init__(self, times: np.ndarray, marks: Sequence[tuple[float, str]]):
        start, end = float(times[0]), float(times[-1])
        self.times = times
        self.range = Range1d(
            start=start, end=end, bounds=(start, end), min_interval=(end - start) * 1e-6
        )
        self.reset = (start, end)
        self.cursor = Span(dimension="height", location=None, line_width=1.5, line_color="#CC3311")
        self.cursor.tags = ["cursor"]
        self._hair = Span(dimension="height", line_dash="dotted", line_width=1, tags=[INK])
        self._marks = marks

    def lines(
        self,
        values: np.ndarray,
        labels: Sequence[str],
        *,
        title: str,
        unit: str,
        log: bool = False,
        steps: bool = False,
        bands: Mapping[int, tuple[np.ndarray, np.ndarray]] | None = None,
    ) -> Chart:
        """Signals (times, n) as lines; `bands` are lower and upper values around some of them."""
        bands = bands or {}
        columns = {f"c{number}": column for number, column in enumerate(values.T)}
        for number, (low, high) in bands.items():
            columns |= {f"low{number}": low, f"high{number}": high}
        if log:
            columns = {key: np.where(value > 0, value, np.nan) for key, value in columns.items()}
        kept = kept_samples(np.stack(list(columns.values()), axis=1))
        data: dict[str, Any] = {key: value[kept].astype("f4") for key, value in columns.items()}
        source = ColumnDataSource({"t": self.times[kept], **data})
        told_unit = shown_unit(unit)
        made = self._figure(told_unit, log)
        for number in bands:
            band = {"fill_color": STYLES[number % MOST_LINES]["color"], "fill_alpha": 0.25}
            area = made.varea("t", f"low{number}", f"high{number}", source=source, **band)
            if band["fill_color"] == "#000000":
                area.glyph.tags = [INK_FILL]
        first = None
        for number in range(len(labels)):
            stroke = stroke_of(number)
            draw = made.step if steps else made.line
            mode = {"mode": "after"} if steps else {}
            line = draw("t", f"c{number}", source=source, **stroke, **mode)
            if stroke["line_color"] == "#000000":
                line.glyph.tags = [INK]
            first = first or line
        self._finish(made, first, labels, told_unit, bands)
        described = f"{title}. {_described(values, labels, told_unit)}"
        return Chart(made, title, described, legend(labels))

    def strips(self, values: np.ndarray, labels: Sequence[str], *, title: str, unit: str) -> Chart:
        """Signals (times, n), too many for lines, as strips of grey; darker is larger."""
        parts = min(len(values), 800)
        begins = np.linspace(0, len(values), parts, endpoint=False).astype(int)
        shades = np.fmax.reduceat(values, begins).astype("f4").T
        start, end = self.reset
        top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
        low = float(np.nanmin(values)) if np.isfinite(values).any() else 0.0
        low = 0.0 if abs(low) < 1e-9 * abs(top) else low
        made = self._figure("", False, y_range=list(map(plain, labels)))
        mapper = LinearColorMapper(palette=cividis(64), low=low, high=max(top, low + 1e-12))
        mapper.nan_color = "rgba(0, 0, 0, 0)"
        drawn = made.image([shades], start, 0, end - start, len(labels), color_mapper=mapper)
        made.height = max(HEIGHT, 18 * len(labels) + 40)
        rows = [("t", "$x{%.6g} s"), (plain(title), f"@image{{%.5g}} {shown_unit(unit)}".rstrip())]
        printed: Any = {"$x": "printf", "@image": "printf"}
        made.tools = [*made.tools, HoverTool(tooltips=rows, formatters=printed, renderers=[drawn])]
        described = f"{title}. {_described(values, labels, shown_unit(unit))}"
        ends = [number_text(end, 3) for end in (low, top)]
        shades = f"from {ends[0]} (dark) to {ends[1]} (bright)"
        shades = shades if ends[0] != ends[1] else f"{ends[0]} all the time"
        more = f"{title}, {shades} {shown_unit(unit)}".rstrip()
        return Chart(made, more, described)

    def overview(self, values: np.ndarray, label: str, unit: str) -> Chart:
        """A signal over the whole time; the box in it is the window of all other plots."""
        start, end = self.reset
        kept = kept_samples(values[:, None], 1500)
        made = new_figure(x_label="", y_label="", x_range=Range1d(start=start, end=end), height=80)
        made.line(self.times[kept], values[kept].astype("f4"), **stroke_of(2))
        made.yaxis.visible = False
        made.ygrid.visible = False
        tool = RangeTool(x_range=self.range, start_gesture="pan")
        tool.overlay.fill_color = "#56B4E9"
        tool.overlay.fill_alpha = 0.2
        made.tools = [tool]
        made.add_layout(self.cursor)
        title = f"{label} over the whole run; drag in here to choose the window"
        described = f"{label} over the whole time, in which a window of time can be chosen."
        return Chart(made, title, described)

    def _figure(self, unit: str, log: bool, **options: Any) -> Any:
        scale: dict[str, Any] = {"y_axis_type": "log"} if log else {}
        y_range = options.pop("y_range", None) or DataRange1d(range_padding=0.08)
        return new_figure(
            x_label="time (s)",
            y_label="degrees" if unit == "°" else unit,
            x_range=self.range,
            y_range=y_range,
            window_axis="x",
            **scale,
            **options,
        )

    def _finish(
        self, made: Any, first: Any, labels: Sequence[str], unit: str, bands: Mapping[int, Any]
    ) -> None:
        """Hover, cursor and marks."""
        for instant, _ in self._marks:
            dashed = {"dimension": "height", "line_dash": "dashed", "tags": [INK]}
            made.add_layout(Span(location=instant, **dashed))
        made.add_layout(self.cursor)
        rows = [("t", "@t{%.6g} s")]
        for number, label in enumerate(labels):
            rows.append((plain(label), f"@c{number}{{%.5g}} {unit}".rstrip()))
            if number in bands:
                rows.append(
                    ("from", f"@low{number}{{%.5g}} {unit} to @high{number}{{%.5g}} {unit}")
                )
        keys = ["t", *(f"c{n}" for n in range(len(labels)))]
        keys += [f"{end}{n}" for n in bands for end in ("low", "high")]
        hover = HoverTool(
            renderers=[first],
            mode="vline",
            tooltips=rows,
            formatters={f"@{key}": "printf" for key in keys},
        )
        made.tools = [*made.tools, hover, CrosshairTool(overlay=self._hair, dimensions="height")]


def shown_unit(unit: str) -> str:
    """A unit of the CF conventions as a person writes it."""
    shown = {"degree": "°", "1": ""}.get(unit, unit)
    return shown.replace(" s-1", "/s").replace("s-1", "1/s").replace("m2", "m²")


def _described(values: np.ndarray, labels: Sequence[str], unit: str) -> str:
    """In words what lines show, for who cannot see them."""
    parts = []
    for label, column in zip(labels, values.T, strict=True):
        good = column[np.isfinite(column)]
        if len(good):
            size = float(np.abs(good).max())
            least, most, last = (
                number_text(one, 3, scale=size) for one in (good.min(), good.max(), good[-1])
            )
            told = f"from {least} to {most}, at the end {last}"
            parts.append(f"{label}: {told} {unit}".rstrip())
    return "; ".join(parts) + "." if parts else "No values."
