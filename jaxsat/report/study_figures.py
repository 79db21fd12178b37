"""Figures of a Monte-Carlo study: its columns or histories in, a matplotlib `Figure` out."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from jaxsat.report.style import LINES, panels

BANDS = ((1.0, 99.0), (10.0, 90.0), (25.0, 75.0))
"""Percentiles between which the shades of a fan chart lie."""


def fan_chart(
    times: np.ndarray, values: np.ndarray, labels: tuple[str, ...], unit: str, title: str
) -> Figure:
    """Median and percentile bands over time, a panel for each component.

    `values` has shape (cases, times, components); NaN, after the end of a failed case, is left out.
    """
    figure, axes = panels(len(labels), title, height=1.8)
    for panel, label, component in zip(axes, labels, np.moveaxis(values, 2, 0), strict=True):
        alive = np.isfinite(component).any(axis=0)
        t, alive_values = times[alive], component[:, alive]
        for low, high in BANDS:
            bounds = np.nanpercentile(alive_values, (low, high), axis=0)
            panel.fill_between(t, *bounds, color="#56B4E9", alpha=0.25, linewidth=0)
        panel.plot(t, np.nanmedian(alive_values, axis=0), **LINES[0])
        panel.set_ylabel(f"{label} ({unit})")
    axes[-1].set_xlabel("time (s)")
    bands = ", ".join(f"{low:g}-{high:g} %" for low, high in BANDS)
    axes[0].set_title(f"median of {len(values)} cases; shaded {bands}", fontsize=8, loc="left")
    return figure


def settling_distribution(settling_time: np.ndarray, title: str) -> Figure:
    """How many cases settle within a time: histogram, and the fraction settled by then."""
    settled = settling_time[np.isfinite(settling_time)]
    figure, (counts, fraction) = panels(2, title)
    if len(settled):
        bins = np.histogram_bin_edges(settled, "auto" if len(settled) < 5000 else 60).tolist()
        counts.hist(settled, bins=bins, color="#56B4E9", edgecolor="#ffffff", linewidth=0.4)
        steps = np.concatenate([[0.0], np.sort(settled)])
        share = np.arange(len(steps)) / len(settling_time)
        fraction.step(steps, share, where="post", **LINES[0])
    counts.set_ylabel("cases")
    fraction.set_ylabel("fraction settled")
    fraction.set_ylim(0, 1)
    fraction.set_xlabel("settling time (s)")
    never = len(settling_time) - len(settled)
    counts.set_title(f"{len(settled)} settled, {never} not", fontsize=8, loc="left")
    return figure


def success_map(
    x: np.ndarray, y: np.ndarray, settled: np.ndarray, labels: tuple[str, str], title: str
) -> Figure:
    """The fraction settled over two dispersed numbers, in cells of equal size; empty where none."""
    cells = int(np.clip(np.sqrt(len(x) / 10), 4, 40))
    figure, (panel,) = panels(1, title, height=4.2)
    fraction, x_edges, y_edges, _ = stats.binned_statistic_2d(
        x, y, settled.astype(float), statistic="mean", bins=cells
    )
    image = panel.pcolormesh(x_edges, y_edges, fraction.T, vmin=0, vmax=1, cmap="cividis")
    figure.colorbar(image, ax=panel, label="fraction settled")
    panel.grid(False)
    panel.set_xlabel(labels[0])
    panel.set_ylabel(labels[1])
    return figure


def convergence(settled: np.ndarray, title: str, level: float = 0.95) -> Figure:
    """The settled fraction with its Wilson interval as cases come in, in their order."""
    figure, (panel,) = panels(1, title, height=3.0)
    count = np.unique(np.geomspace(1, len(settled), 200).astype(int))
    fraction = np.cumsum(settled)[count - 1] / count
    weight = stats.norm.ppf((1 + level) / 2) ** 2 / count
    centre = (fraction + weight / 2) / (1 + weight)
    half = np.sqrt(weight * (fraction * (1 - fraction) + weight / 4)) / (1 + weight)
    panel.fill_between(count, centre - half, centre + half, color="#56B4E9", alpha=0.3)
    panel.plot(count, fraction, **LINES[0])
    panel.set_xscale("log")
    panel.set_ylim(-0.02, 1.02)
    panel.set_xlabel("cases")
    panel.set_ylabel("fraction settled")
    panel.set_title(f"with its {level:.0%} Wilson interval", fontsize=8, loc="left")
    return figure


def study_figures(
    columns: Mapping[str, np.ndarray],
    drawn: Mapping[str, np.ndarray],
    axes: tuple[str, str] | None,
    title: str,
) -> dict[str, Figure]:
    """The figures of a study's columns; `axes` are two of the names in `drawn` for the map."""
    settling_time = np.asarray(columns["settling_time"])
    settled = np.isfinite(settling_time)
    figures = {
        "settling": settling_distribution(settling_time, f"{title}: settling time"),
        "convergence": convergence(settled, f"{title}: estimate"),
    }
    if axes is not None:
        x, y = (np.asarray(drawn[name]) for name in axes)
        figures["success"] = success_map(x, y, settled, axes, f"{title}: where it settles")
    return figures
