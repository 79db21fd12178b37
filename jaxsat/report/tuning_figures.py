"""Figures of a tuning run: its history or the verdict's columns in, a matplotlib `Figure` out."""

from collections.abc import Mapping

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxsat.report.style import LINES, escape_mathematics, line_of, panels

FAINT = {"color": "#999999", "linestyle": "-", "linewidth": 0.8}
BEFORE, AFTER = LINES[1], LINES[0]


def loss_figure(history: xr.Dataset, title: str) -> Figure:
    """Loss in training and on the validation cases, gradient norm, and the fraction settled."""
    figure, (loss, gradient, settled) = panels(3, title)
    step, checks = history["step"].values, history["validation"].values
    for start in history["start"].values:
        one = history.sel(start=start)
        loss.plot(step, one["loss"], **FAINT, label="training, each start" if not start else None)
        gradient.plot(step, one["gradient_norm"], **FAINT)
        settled.plot(step, one["settled"], **FAINT)
    loss.plot(checks, history["best_loss"], **LINES[0], label="validation, best so far (exact law)")
    best = history["validation_settled"].max("start", skipna=True)
    settled.plot(checks, best, **LINES[0], label="validation, highest of the starts")
    for panel in (loss, gradient):
        panel.set_yscale("log")
    loss.set_ylabel("loss (1)")
    gradient.set_ylabel("gradient norm (1)")
    settled.set_ylabel("fraction settled (1)")
    settled.set_ylim(-0.02, 1.02)
    settled.set_xlabel("step")
    loss.legend(fontsize=8)
    settled.legend(fontsize=8)
    return figure


def gains_figure(history: xr.Dataset, title: str) -> Figure:
    """Every gain on its way, all starts, and that of the best iterate so far."""
    labels = [str(label) for label in history["parameter"].values]
    figure, axes = panels(len(labels), title, height=1.7)
    scales = np.atleast_1d(history.attrs["parameter_scales"])
    units = np.atleast_1d(history.attrs["parameter_units"])
    for panel, label, scale, unit in zip(axes, labels, scales, units, strict=True):
        one = history.sel(parameter=label)
        for start in history["start"].values:
            panel.plot(history["step"], one["gain"].sel(start=start), **FAINT)
        panel.plot(history["validation"], one["best_gain"], **LINES[0], drawstyle="steps-post")
        panel.set_yscale("log" if scale == "log" else "linear")
        panel.set_ylabel(escape_mathematics(f"{label} ({unit})"))
    axes[0].set_title("grey: every start; black: best so far", fontsize=8, loc="left")
    axes[-1].set_xlabel("step")
    return figure


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
