"""Plots of a study: of fractions and percentiles, so that their size does not grow with it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, HoverTool

from jaxsat.report.document import Chart
from jaxsat.report.page.charts import INK, INK_FILL, legend, new_figure, plain, stroke_of
from jaxsat.report.page.decimation import kept_samples
from jaxsat.studies import percent_texts, wilson

POINTS, BINS, HEIGHT = 400, 20, 260
"""Points of a line, bins of a quantity, height of a plot."""

LEAST = 10
"""Cases that a bin must have to be drawn."""

BLUE = "#56B4E9"


def settled_by_chart(times: np.ndarray) -> Chart | None:
    """The fraction of all cases that is settled by a time, with Wilson's interval."""
    good = np.sort(times[np.isfinite(times)])
    if not len(good):
        return None
    at = np.unique(np.quantile(good, np.linspace(0, 1, POINTS), method="inverted_cdf"))
    fractions = [wilson(int(n), len(times)) for n in np.searchsorted(good, at, side="right")]
    middle = f"half of all cases by {np.quantile(times, 0.5, method='inverted_cdf'):.4g} s"
    told = f"{percent_texts(fractions[-1])[0]} of the cases settle, {middle}."
    title = "Fraction settled by a time, with its 95 % Wilson interval"
    return _banded(title, told, at, np.array(fractions), ("time (s)", "fraction"), ("s", ""), True)


def settling_times_chart(times: np.ndarray) -> Chart | None:
    """How the settling times of those that settle are distributed."""
    good = times[np.isfinite(times)]
    if len(good) < 2:
        return None
    counts, edges = np.histogram(good, bins=min(60, max(5, int(np.sqrt(len(good))))))
    made = new_figure(x_label="settling time (s)", y_label="cases", height=HEIGHT)
    data: dict[str, Any] = {"left": edges[:-1], "right": edges[1:], "top": counts}
    source = ColumnDataSource(data)
    bars = made.quad(
        left="left",
        right="right",
        top="top",
        bottom=0,
        source=source,
        fill_color=BLUE,
        line_color=None,
    )
    _hover(made, bars, [("settling time", "@left{%.5g} to @right{%.5g} s"), ("cases", "@top{%d}")])
    low, middle, high = np.quantile(good, [0.1, 0.5, 0.9])
    told = f"10 % settle by {low:.4g} s, half by {middle:.4g} s, 90 % by {high:.4g} s."
    return Chart(made, "Settling times of the cases that settle", told)


def convergence_chart(times: np.ndarray) -> Chart:
    """The settled fraction as cases come in, with Wilson's interval."""
    settled = np.cumsum(np.isfinite(times))
    at = np.unique(np.geomspace(1, len(times), POINTS).astype(int))
    found = [wilson(int(settled[n - 1]), int(n)) for n in at]
    told = f"After {len(times):,} cases {percent_texts(found[-1])[0]}."
    title = "Fraction settled over the number of cases, with its 95 % Wilson interval"
    return _banded(title, told, at, np.array(found), ("cases", "fraction"), ("", ""), False)


def success_chart(label: str, values: np.ndarray, settled: np.ndarray, unit: str) -> Chart | None:
    """The fraction settled over a dispersed quantity, in bins of equally many cases."""
    parts = _bins(values)
    if not parts:
        return None
    fractions = np.array([wilson(int(settled[one].sum()), len(one)) for one in parts])
    middles = np.array([np.median(values[one]) for one in parts])
    low, high = fractions[:, 0].argmin(), fractions[:, 0].argmax()
    ends = {"Least": low, "most": high}
    parts_told = [
        f"{k} {fractions[n, 0]:.1%} near {middles[n]:.3g} {unit}" for k, n in ends.items()
    ]
    told = f"{', '.join(parts_told)}."
    title = f"Fraction settled over {label}, with its 95 % Wilson interval"
    axes = (_axis(label, unit), "fraction")
    return _banded(title, told, middles, fractions, axes, (unit, ""), False, points=True)


def settling_over_chart(
    label: str, values: np.ndarray, times: np.ndarray, unit: str
) -> Chart | None:
    """Median settling time over a dispersed quantity, with the 10 % and 90 % points."""
    good = np.isfinite(times)
    parts = _bins(values[good])
    if not parts:
        return None
    there = values[good], times[good]
    middles = np.array([np.median(there[0][one]) for one in parts])
    points = np.array([np.quantile(there[1][one], [0.5, 0.1, 0.9]) for one in parts])
    told = f"Medians from {points[:, 0].min():.4g} to {points[:, 0].max():.4g} s."
    title = f"Settling time over {label}: median, 10 % and 90 % points of those that settle"
    axes = (_axis(label, unit), "settling time (s)")
    return _banded(title, told, middles, points, axes, (unit, "s"), False, points=True)


def curves_chart(
    title: str,
    curves: Mapping[str, tuple[np.ndarray, np.ndarray]],
    axes: Sequence[str],
    *,
    log: str = "",
    steps: bool = False,
) -> Chart:
    """Lines with x values of their own, by name, as many as can be told apart; `log`: "x", "y"."""
    scales = {f"{axis}_axis_type": "log" for axis in log}
    made = new_figure(x_label=axes[0], y_label=axes[1], height=HEIGHT, **scales)
    told = []
    for number, (label, (x, y)) in enumerate(curves.items()):
        kept = kept_samples(y[:, None])
        source = ColumnDataSource({"x": x[kept], "y": y[kept]})
        stroke = stroke_of(number)
        if steps:
            line = made.step("x", "y", source=source, mode="after", **stroke)
        else:
            line = made.line("x", "y", source=source, **stroke)
        if stroke["line_color"] == "#000000":
            line.glyph.tags = [INK]
        _hover(made, line, [(label, "@y{%.5g}"), (axes[0], "@x{%.5g}")], "mouse")
        good = y[np.isfinite(y)]
        told.append(f"{label}: ends at {good[-1]:.4g}" if len(good) else f"{label}: no values")
    return Chart(made, title, f"{title}. {'; '.join(told)}.", legend(list(curves)))


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Places of the values in bins of equally many; none where the values do not vary."""
    if len(values) < 2 * LEAST or not np.ptp(values) > 0:
        return []
    bins = max(2, min(BINS, len(values) // (5 * LEAST)))
    edges = np.unique(np.quantile(values, np.linspace(0, 1, bins + 1)))
    places = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, len(edges) - 2)
    parts = [np.flatnonzero(places == one) for one in range(len(edges) - 1)]
    return [part for part in parts if len(part) >= LEAST]


def _banded(
    title: str,
    told: str,
    x: np.ndarray,
    values: np.ndarray,
    axes: Sequence[str],
    units: Sequence[str],
    steps: bool,
    *,
    points: bool = False,
) -> Chart:
    """A line over x with a band: `values` (n, 3) are middle, lower and upper."""
    log = {"x_axis_type": "log"} if axes[0] == "cases" else {}
    made = new_figure(x_label=axes[0], y_label=axes[1], height=HEIGHT, **log)
    middle, low, high = values.T
    source = ColumnDataSource({"x": x, "y": middle, "low": low, "high": high})
    band = {"fill_color": BLUE, "fill_alpha": 0.4}
    ink = {"line_color": "#000000", "line_width": 1.4}
    if steps:
        made.varea_step("x", "low", "high", source=source, step_mode="after", **band)
        line = made.step(
            "x", "y", source=source, mode="after", line_color="#000000", line_width=1.4
        )
    else:
        made.varea("x", "low", "high", source=source, **band)
        line = made.line("x", "y", source=source, **ink)
    line.glyph.tags = [INK]
    if points:
        dots = made.scatter("x", "y", source=source, size=6, fill_color="#000000", line_color=None)
        dots.glyph.tags = [INK_FILL]
    form = "{%.5g}"
    rows = [
        (axes[0].partition(" (")[0], f"@x{form} {units[0]}".rstrip()),
        (axes[1].partition(" (")[0], f"@y{form} {units[1]}".rstrip()),
        ("range", f"@low{form} to @high{form} {units[1]}".rstrip()),
    ]
    _hover(made, line, rows)
    return Chart(made, title, f"{title}. {told}")


def _hover(made: Any, drawn: Any, rows: list[tuple[str, str]], mode: Any = "vline") -> None:
    """What a pointer is told of the nearest point."""
    keys = ("x", "y", "low", "high", "left", "right", "top")
    printed: Any = {f"@{key}": "printf" for key in keys}
    told = [(plain(label), text) for label, text in rows]
    hover = HoverTool(renderers=[drawn], mode=mode, tooltips=told, formatters=printed)
    made.tools = [*made.tools, hover]


def _axis(label: str, unit: str) -> str:
    return f"{label} ({unit})" if unit not in ("", "1") else label
