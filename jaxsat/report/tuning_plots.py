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
    told = f"Validation, the best so far (exact law), ends at {best[-1]:.4g}. Grey: every start."
    return [
        Plot("Loss", told, STEP, Axis("loss", log=True),
             [Line(checks, best, "validation, best so far"), *_starts(history, "loss")]),
        Plot("Gradient", "Grey: every start.", STEP, Axis("gradient norm", log=True),
             list(_starts(history, "gradient_norm"))),
        Plot("Fraction settled", "Black: validation, highest of the starts. Grey: every start.",
             STEP, Axis("fraction settled", limits=(-0.02, 1.02)),
             [Line(checks, settled, "validation, highest"), *_starts(history, "settled")]),
    ]  # fmt: skip


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
        told = f"Black: best so far, ends at {best[-1]:.4g}. Grey: every start."
        plots.append(Plot(label, told, STEP, axis, lines))
    return plots


def _starts(history: xr.Dataset, name: str) -> Iterator[Line]:
    for values in history[name].transpose("start", "step").values:
        yield Line(history["step"].values, values, faint=True)
