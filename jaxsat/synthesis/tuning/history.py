"""History of a run as a labelled dataset."""

from typing import Any

import numpy as np
import xarray as xr

from jaxsat.core.text import clean
from jaxsat.store.labelled import LabelledArray
from jaxsat.store.labels import Label
from jaxsat.store.provenance import provenance_attributes
from jaxsat.synthesis.tuning.descent import DescentState
from jaxsat.synthesis.tuning.plan import TuningPlan

STEP_VARIABLES = {
    "loss": "objective in training before the step, smooth law",
    "gradient_norm": "length of its gradient along the search",
    "settled": "fraction of the step's cases that settled",
    "failed": "cases of the step that ended early and were charged for it",
    "masked": "cases of the step without a finite cost and derivative",
    "bounded": "cases of the step whose derivative was cut to its bound",
}

VALIDATION_VARIABLES = {
    "validation_loss": ("loss", "objective on the validation cases, exact law"),
    "validation_settled": ("settled", "fraction of the validation cases that settled"),
}
"""Numbers of a validation by name, and their meaning."""

SPENT = "whole horizons computed by then"


def history_dataset(plan: TuningPlan, state: DescentState, title: str, scenario: str) -> xr.Dataset:
    """Return steps, validations and gains of a run; `scenario` is the text of its scenario."""
    size, starts = plan.space.size, len(state.points)
    gains = plan.space.to_values(_stack([r.points for r in state.steps], (starts, size)))
    interval = float(plan.smooth.program.interval)
    meaning = "gains before the step, each in the unit of its key in [control]"
    axes = ("step", "start", "parameter")
    variables = {"gain": LabelledArray(axes, gains, {"long_name": meaning})}
    steps, checks = state.steps, state.validations
    for name, meaning in STEP_VARIABLES.items():
        values = _stack([getattr(one, name) for one in steps], (starts,))
        variables[name] = Label(("step", "start"), "1", meaning).array(values)
    for name, (key, meaning) in VALIDATION_VARIABLES.items():
        values = _stack([getattr(one, key) for one in checks], (starts,))
        variables[name] = Label(("validation", "start"), "1", meaning).array(values)
    best = plan.space.to_values(_stack([one.best_point for one in checks], (size,)))
    meaning = "gains of the least validation loss so far"
    variables["best_gain"] = Label(("validation", "parameter"), "1", meaning).array(best)
    horizons = [one.horizon * interval for one in steps]
    least = [one.best_loss for one in checks]
    of_all: dict[str, tuple[str, str, str, list[Any]]] = {
        "horizon": ("step", "s", "horizon of the step's runs", horizons),
        "trajectories": ("step", "1", SPENT, [one.trajectories for one in steps]),
        "best_loss": ("validation", "1", "least validation loss so far", least),
        "validation_trajectories": ("validation", "1", SPENT, [one.trajectories for one in checks]),
    }
    for name, (axis, unit, meaning, numbers) in of_all.items():
        variables[name] = Label((axis,), unit, meaning).array(numbers)
    return xr.Dataset(
        variables,
        coords={
            "step": np.arange(len(steps)),
            "start": np.arange(starts),
            "parameter": list(plan.space.labels),
            "validation": np.array([check.step for check in checks]),
        },
        attrs={
            "title": clean(title),
            "scenario": scenario,
            "parameter_units": list(plan.space.units),
            "parameter_scales": list(plan.space.scales),
            **provenance_attributes(),
        },
    )


def _stack(parts: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    return np.stack(parts) if parts else np.zeros((0, *shape))
