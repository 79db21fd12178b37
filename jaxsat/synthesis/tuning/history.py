"""History of a run as a labelled dataset."""

import numpy as np
import xarray as xr

from jaxsat.core.text import clean
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


def history_dataset(plan: TuningPlan, state: DescentState, title: str, scenario: str) -> xr.Dataset:
    """Return steps, validations and gains of a run; `scenario` is the text of its scenario."""
    size, starts = plan.space.size, len(state.points)
    gains = plan.space.to_values(_stack([r.points for r in state.steps], (starts, size)))
    interval = float(plan.smooth.program.interval)
    variables: dict[str, tuple] = {
        "gain": (
            ("step", "start", "parameter"),
            gains,
            {"long_name": "gains before the step, each in the unit of its key in [control]"},
        )
    }
    for name, meaning in STEP_VARIABLES.items():
        values = _stack([getattr(record, name) for record in state.steps], (starts,))
        variables[name] = (("step", "start"), values, _attributes(meaning))
    horizons = np.array([record.horizon for record in state.steps]) * interval
    trajectories = np.array([record.trajectories for record in state.steps])
    variables["horizon"] = (("step",), horizons, _attributes("horizon of the step's runs", "s"))
    variables["trajectories"] = (
        ("step",),
        trajectories,
        _attributes("whole horizons computed by then"),
    )
    checks = state.validations
    variables["validation_loss"] = (
        ("validation", "start"),
        _stack([check.loss for check in checks], (starts,)),
        _attributes("objective on the validation cases, exact law"),
    )
    variables["validation_settled"] = (
        ("validation", "start"),
        _stack([check.settled for check in checks], (starts,)),
        _attributes("fraction of the validation cases that settled"),
    )
    variables["best_loss"] = (
        ("validation",),
        np.array([check.best_loss for check in checks]),
        _attributes("least validation loss so far"),
    )
    variables["best_gain"] = (
        ("validation", "parameter"),
        plan.space.to_values(_stack([check.best_point for check in checks], (size,))),
        _attributes("gains of the least validation loss so far"),
    )
    variables["validation_trajectories"] = (
        ("validation",),
        np.array([check.trajectories for check in checks]),
        _attributes("whole horizons computed by then"),
    )
    return xr.Dataset(
        variables,
        coords={
            "step": np.arange(len(state.steps)),
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


def _attributes(meaning: str, units: str = "1") -> dict[str, str]:
    return {"long_name": meaning, "units": units}


def _stack(parts: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    return np.stack(parts) if parts else np.zeros((0, *shape))
