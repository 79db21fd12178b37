"""Figures of a Monte-Carlo study: columns or histories in, a matplotlib `Figure` out."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from jaxsat.core.attitude import pointing_error
from jaxsat.core.declaration.units import shown_unit
from jaxsat.report import study_plots
from jaxsat.report.figure_painter import paint
from jaxsat.report.saving import save_figures
from jaxsat.report.style import STYLES, panels
from jaxsat.simulation.trajectory import Signals
from jaxsat.store.tables import open_study
from jaxsat.studies.ensemble import Study
from jaxsat.studies.sensitivities import numbers_of
from jaxsat.studies.summary import Summary

Drawings = dict[str, Callable[[], Figure]]
"""Functions that draw figures, by file name."""

BANDS = ((1.0, 99.0), (10.0, 90.0), (25.0, 75.0))
"""Percentiles that bound the bands of a fan chart."""

SHADES = ("#dbeefa", "#a9d6f3", "#6fbbe8")
"""Shades of the bands from the widest to the narrowest."""

RARE = 3.0
"""Span of the widest band, over that of the second one, beyond which it is cut."""

SYMBOLS = {"omega": "ω", "inertia": "ΔJ/J ", "rate_error": "η", "constant_torque": "T"}
"""Symbols of components of some dispersed quantities on an axis."""

SEEN_CASES = 500
"""Largest number of cases that are marked in a map."""


def fan_chart(
    times: np.ndarray,
    values: np.ndarray,
    labels: Sequence[str],
    title: str,
    *,
    logarithmic: bool = False,
) -> Figure:
    """Plot median and percentile bands over time (s), a panel for each component.

    `values` has shape (cases, times, components); NaN, after the end of a failed case, is left out.
    """
    figure, rows = panels(title, (7.0, 1.8 * len(labels) + 0.7), len(labels))
    axes = [panel for (panel,) in rows]
    for panel, label, component in zip(axes, labels, np.moveaxis(values, 2, 0), strict=True):
        panel.set_ylabel(label)
        alive = np.isfinite(component).any(axis=0)
        if not alive.any():
            panel.set_title("no case can exist", fontsize=8, loc="right")
            continue
        t, alive_values = times[alive], component[:, alive]
        for (low, high), shade in zip(BANDS, SHADES, strict=True):
            bounds = np.nanpercentile(alive_values, (low, high), axis=0)
            band = f"{low:g} to {high:g} %"
            panel.fill_between(t, *bounds, color=shade, linewidth=0, label=band)
        panel.plot(t, np.nanmedian(alive_values, axis=0), label="median", **STYLES[0])
        panel.margins(x=0)
        if logarithmic:
            panel.set_yscale("log", nonpositive="mask")
        else:
            _cut_rare(panel, alive_values)
    axes[-1].set_xlabel("time (s)")
    handles, names = next(
        (pair for pair in (panel.get_legend_handles_labels() for panel in axes) if pair[0]),
        ([], []),
    )
    figure.legend(
        handles,
        names,
        loc="outside lower center",
        ncols=len(names) or 1,
        fontsize=8,
        title=f"percentiles of {len(values)} cases",
        title_fontsize=8,
        frameon=False,
    )
    figure.align_ylabels(axes)
    return figure


def _cut_rare(panel: Axes, values: np.ndarray) -> None:
    """Cut the widest band's peaks where they would hide the rest: w is large upside down."""
    (least, low), (high, most) = (
        np.nanpercentile(values, band, axis=0).reshape(2, -1)
        for band in ((BANDS[0][0], BANDS[1][0]), (BANDS[1][1], BANDS[0][1]))
    )
    bottom, top = low.min(), high.max()
    span = top - bottom
    if most.max() - least.min() > RARE * span:
        panel.set_ylim(bottom - span / 2, top + span / 2)
        panel.set_title("rare peaks are cut off", fontsize=8, loc="right")


def fan_figures(times: np.ndarray, signals: Signals, title: str) -> dict[str, Figure]:
    """Return fan charts of pointing error, attitude and rates from signals (cases, times)."""
    total = np.linalg.norm(pointing_error(np.asarray(signals.quaternion)), axis=-1)
    speed = np.degrees(np.linalg.norm(np.asarray(signals.relative_rate), axis=-1))
    errors = np.stack([total, speed], axis=2)
    attitude = np.concatenate([signals.w, np.asarray(signals.z)[:, :, None]], axis=2)
    rates = np.asarray(signals.omega)
    names = ("ω1 (rad/s)", "ω2 (rad/s)", "ω3 (rad/s)")
    sizes = ("total pointing\nerror (°)", "rate relative to\nthe orbit frame (°/s)")
    tilts = ("tilt w1 (–)", "tilt w2 (–)", "turn z (rad)")
    return {
        "pointing-fan": fan_chart(
            times, errors, sizes, f"{title}: pointing error", logarithmic=True
        ),
        "attitude-fan": fan_chart(times, attitude, tilts, f"{title}: attitude"),
        "rates-fan": fan_chart(times, rates, names, f"{title}: rates"),
    }


def settling_distribution(settling_time: np.ndarray, title: str) -> Figure:
    """Plot the fraction settled by a time, and a histogram of settling times."""
    plots = [study_plots.settled_by(settling_time), study_plots.settling_times(settling_time)]
    available_plots = [plot for plot in plots if plot is not None]
    if available_plots:
        return paint(available_plots, title)
    figure, ((panel,),) = panels(title, (7.0, 1.9))
    text = f"none of {len(settling_time)} cases settled"
    panel.text(0.5, 0.5, text, ha="center", va="center", transform=panel.transAxes)
    panel.set_axis_off()
    return figure


def convergence(settled: np.ndarray, title: str) -> Figure:
    """Plot the settled fraction with its Wilson interval over the number of cases."""
    return paint([study_plots.convergence(settled)], title, 3.0)


class DrawnNumber(NamedTuple):
    """A dispersed number of every case, its unit and its meaning."""

    values: np.ndarray
    unit: str
    meaning: str


def axis_label(name: str, number: DrawnNumber) -> str:
    """Return the label of a dispersed number: name, unit, and in a second line its meaning."""
    unit = "" if number.unit == "1" else f" ({number.unit})"
    base, _, component = name.removesuffix("]").partition("[")
    symbol = SYMBOLS.get(base)
    short = f"{symbol}{component}" if symbol and component else name.replace("_", " ")
    return f"{short}{unit}\n{number.meaning}"


def success_map(
    x: np.ndarray, y: np.ndarray, settled: np.ndarray, labels: tuple[str, str], title: str
) -> Figure:
    """Plot the fraction settled over two dispersed numbers, in cells of equal size."""
    cells = int(np.clip(np.sqrt(len(x) / 10), 4, 40))
    figure, ((panel,),) = panels(title, (7.0, 4.9))
    fraction, x_edges, y_edges, _ = stats.binned_statistic_2d(
        x, y, settled.astype(float), statistic="mean", bins=cells
    )
    image = panel.pcolormesh(x_edges, y_edges, fraction.T, vmin=0, vmax=1, cmap="cividis")
    figure.colorbar(image, ax=panel, label="fraction settled")
    panel.grid(False)
    panel.set_xlabel(labels[0])
    panel.set_ylabel(labels[1])
    each = len(x) / cells**2
    panel.set_title(
        f"{len(x)} cases, {each:.0f} a cell on average; white where none", fontsize=8, loc="left"
    )
    if len(x) <= SEEN_CASES:
        _mark_cases(panel, x, y, settled)
    return figure


def _mark_cases(panel: Axes, x: np.ndarray, y: np.ndarray, settled: np.ndarray) -> None:
    """Mark every case; dots and crosses have white edges, visible on any colour."""
    edge = [patheffects.withStroke(linewidth=2.2, foreground="white")]
    for members, marker, name in ((settled, ".", "settled"), (~settled, "x", "not settled")):
        panel.plot(
            x[members],
            y[members],
            marker,
            color="black",
            markersize=4,
            markeredgewidth=0.9,
            label=name,
            path_effects=edge,
        )
    panel.legend(
        loc="lower right",
        ncols=2,
        bbox_to_anchor=(1, 1),
        borderaxespad=0.1,
        frameon=False,
        fontsize=8,
    )


FAN_INSTANTS, FAN_CASES = 500, 64
"""Approximate number of instants in a figure, and number of cases flown again for fan charts."""


def write_study_figures(
    write: Callable[[str, bytes], Any], title: str, study: Study, store: Path, summary: Summary
) -> None:
    """Pass the figures of a study in its store to `write`, with a file name and the content.

    Raises `OutputError` for a store that cannot be read.
    """
    dataset = open_study(store)
    every = max(1, study.program.intervals // FAN_INSTANTS)
    signals = _histories(study, np.arange(min(summary.cases, FAN_CASES)), every)
    times = study.program.instants(every) * float(study.program.interval)
    drawings = stored_drawings(dataset, summary, title)
    save_figures(lambda: {**drawings, **fan_figures(times, signals, title)}, write)


def _histories(study: Study, numbers: np.ndarray, every: int) -> Signals:
    size = study.engine.batch_size
    batches = [numbers[first : first + size] for first in range(0, len(numbers), size)]
    parts = [
        study.engine.histories(study.program, study.cases(batch), study.gains, every=every)
        for batch in batches
    ]
    return jax.tree.map(lambda *some: np.concatenate(some), *parts)


def _drawn_number(dataset: xr.Dataset, label: str, cases: np.ndarray) -> DrawnNumber:
    """Return a number drawn for these cases, by its name in a sensitivity ranking."""
    name = label.partition("[")[0]
    column = dataset[f"drawn_{name}"]
    values = numbers_of(name, np.asarray(column)[cases])[label]
    unit, meaning = shown_unit(column.attrs["units"]) or "1", column.attrs["long_name"]
    if label == "attitude[angle]":
        unit, meaning = "rad", "rotation from the orbit to the body frame at the start"
    elif name == "attitude":
        meaning = "its axis"
    return DrawnNumber(values, unit, meaning)


def stored_drawings(dataset: xr.Dataset, summary: Summary, title: str) -> Drawings:
    """Return `study_drawings` of a store, over the two drawn numbers that matter most."""
    labels = [entry.name for entry in summary.ranking if entry.matters][:2]
    cases = np.flatnonzero(np.asarray(dataset["status"]) == 1)[: summary.cases]
    numbers = {label: _drawn_number(dataset, label, cases) for label in labels}
    columns = {"settling_time": np.asarray(dataset["settling_time"])[cases]}
    return study_drawings(columns, numbers, title)


def study_drawings(
    columns: Mapping[str, np.ndarray], numbers: Mapping[str, DrawnNumber], title: str
) -> Drawings:
    """Return functions that draw a study's columns, and the map of two dispersed `numbers`."""
    settling_time = np.asarray(columns["settling_time"])
    settled = np.isfinite(settling_time)
    drawings: Drawings = {
        "settling": lambda: settling_distribution(settling_time, f"{title}: settling time"),
        "convergence": lambda: convergence(settled, f"{title}: estimate"),
    }
    if len(numbers) == 2:
        x, y = (np.asarray(number.values) for number in numbers.values())
        first, second = (axis_label(name, number) for name, number in numbers.items())
        where = f"{title}: where it settles"
        drawings["success"] = lambda: success_map(x, y, settled, (first, second), where)
    return drawings
