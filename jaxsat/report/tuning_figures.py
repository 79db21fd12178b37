"""Figures of a tuning run: its history or the verdict's columns in, a matplotlib `Figure` out."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxsat.report.figure_painter import paint
from jaxsat.report.style import LINES, escape_mathematics, line_of, panels
from jaxsat.report.tuning_plots import gain_plots, loss_plots

BEFORE, AFTER = LINES[1], LINES[0]


def loss_figure(history: xr.Dataset, title: str) -> Figure:
    """Loss in training and on the validation cases, gradient norm, and the fraction settled."""
    return paint(loss_plots(history), title)


def gains_figure(history: xr.Dataset, title: str) -> Figure:
    """Every gain on its way, all starts, and that of the best iterate so far."""
    return paint(gain_plots(history), title, 1.9)


def before_after_figure(
    before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray], title: str
) -> Figure:
    """What fraction of the held-out cases is below a settling time, effort or cost."""
    figure, axes = panels(3, title, height=2.4)
    quantities = (
        ("settling_time", "settling time (s)", "linear"),
        ("effort", "effort (N m s)", "log"),
        ("cost", "cost (1)", "log"),
    )
    for panel, (name, label, scale) in zip(axes, quantities, strict=True):
        for columns, line, who in ((before, BEFORE, "before"), (after, AFTER, "after")):
            values = columns[name]
            known = np.sort(values[np.isfinite(values)])
            share = np.arange(1, len(known) + 1) / len(values)
            panel.step(known, share, where="post", label=f"{who}, {len(values)} cases", **line)
        panel.set_xscale(scale)
        panel.set_xlabel(label)
        panel.set_ylabel("fraction below (1)")
        panel.set_ylim(-0.02, 1.02)
    axes[0].legend(fontsize=8)
    return figure


def baselines_figure(traces: Mapping[str, np.ndarray], title: str) -> Figure:
    """Validation loss of the best point so far over trajectories spent, a line each method."""
    figure, (panel,) = panels(1, title, height=3.6)
    for number, (name, trace) in enumerate(traces.items()):
        look = {"drawstyle": "steps-post", **line_of(number)}
        panel.plot(trace[:, 0], trace[:, 1], label=escape_mathematics(name), **look)
    panel.set_xscale("symlog", linthresh=100)
    panel.set_yscale("log")
    panel.set_xlabel("trajectories computed (whole horizons; a gradient of n gains counts n + 1)")
    panel.set_ylabel("validation loss, exact law (1)")
    panel.legend(fontsize=8)
    return figure
