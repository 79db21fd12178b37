"""Plots of a tuning run's history."""

from collections.abc import Iterator

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
        told = f"The best so far ends at {best[-1]:.4g}."
        plots.append(Plot(label, told, STEP, axis, lines))
    return plots


def _starts(history: xr.Dataset, name: str) -> Iterator[Line]:
    for number, values in enumerate(history[name].transpose("start", "step").values):
        label = "" if number else "training, every start"
        yield Line(history["step"].values, values, label, faint=True)
