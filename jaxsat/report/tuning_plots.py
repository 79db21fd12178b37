"""Plots of a tuning run: its history, the verdict's cases before and after, and other methods."""

from collections.abc import Iterator, Mapping

import numpy as np
import xarray as xr

from jaxsat.report.plot import Axis, Line, Plot

STEP = Axis("step")


def loss_plots(history: xr.Dataset) -> list[Plot]:
    """Loss in training and on the validation cases, gradient norm, and the fraction settled."""
    checks, best = history["validation"].values, history["best_loss"].values
    settled = history["validation_settled"].max("start", skipna=True).values
    ends = f"On the validation cases the best so far ends at {best[-1]:.4g}."
    most = f"On the validation cases {settled[-1]:.1%} at the end, the highest of the starts."
    validation = Line(checks, best, "validation, best so far (exact law)")
    highest = Line(checks, settled, "validation, highest of the starts")
    share = Axis("fraction settled", limits=(-0.02, 1.02))
    loss, norm = Axis("loss", log=True), Axis("gradient norm", log=True)
    gradients = list(_starts(history, "gradient_norm"))
    return [
        Plot("Loss", ends, STEP, loss, [validation, *_starts(history, "loss")]),
        Plot("Gradient norm", "In training, every start.", STEP, norm, gradients),
        Plot("Fraction settled", most, STEP, share, [highest, *_starts(history, "settled")]),
    ]


def gain_plots(history: xr.Dataset) -> list[Plot]:
    """Every gain on its way, all starts, and that of the best iterate so far."""
    checks, plots = history["validation"].values, []
    scales = np.atleast_1d(history.attrs["parameter_scales"])
    units = np.atleast_1d(history.attrs["parameter_units"])
    for label, scale, unit in zip(
        map(str, history["parameter"].values), scales, units, strict=True
    ):
        one = history.sel(parameter=label)
        best = one["best_gain"].values
        axis = Axis(label, str(unit), log=scale == "log")
        lines = [Line(checks, best, "best so far", steps=True), *_starts(one, "gain")]
        sentence = f"The best so far ends at {best[-1]:.4g}."
        plots.append(Plot(label, sentence, STEP, axis, lines))
    return plots


def _starts(history: xr.Dataset, name: str) -> Iterator[Line]:
    for number, values in enumerate(history[name].transpose("start", "step").values):
        label = "" if number else "training, every start"
        yield Line(history["step"].values, values, label, faint=True)


def before_after_plots(
    before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray]
) -> list[Plot]:
    """What fraction of the held-out cases is below a settling time, effort or cost."""
    quantities = {
        "settling_time": Axis("settling time", "s"),
        "effort": Axis("effort", "N m s", log=True),
        "cost": Axis("cost", "1", log=True),
    }
    share = Axis("fraction below", "1", limits=(-0.02, 1.02))
    plots = []
    for name, axis in quantities.items():
        lines = []
        for columns, who in ((after, "after"), (before, "before")):
            values = columns[name]
            finite_values = np.sort(values[np.isfinite(values)])
            shares = np.arange(1, len(finite_values) + 1) / len(values)
            lines.append(Line(finite_values, shares, f"{who}, {len(values)} cases", steps=True))
        plots.append(Plot(axis.label, "", axis, share, lines))
    return plots


def methods_plot(traces: Mapping[str, np.ndarray]) -> Plot:
    """Validation loss of the best point so far over trajectories spent, a line each method."""
    axis = Axis("trajectories computed (a gradient of n gains: n + 1)", linear_to=100.0)
    loss = Axis("validation loss, exact law", log=True)
    lines = [Line(one[:, 0], one[:, 1], name, steps=True) for name, one in traces.items()]
    return Plot("the best point so far of each method", "", axis, loss, lines)
