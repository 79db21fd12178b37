"""State of a tuning run in its folder, from which the run is resumed; its history as arrays."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jaxsat.core.text import clean
from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.store.labelled import LabelledArray
from jaxsat.store.labels import Label
from jaxsat.store.provenance import provenance_attributes
from jaxsat.store.resumable import ResumableFolder
from jaxsat.synthesis.execution import resumable_folder
from jaxsat.synthesis.tuning.descent import DescentState, StepRecord, ValidationRecord
from jaxsat.synthesis.tuning.plan import TuningPlan

CHECKPOINT = "checkpoint.npz"
"""File of the state; the folder refuses one that is not as it was written."""

FORMAT = 3
"""Form of the state, part of a run's identity."""


def tuning_folder(
    path: str | Path, plan: TuningPlan, *, elsewhere: bool = False
) -> ResumableFolder:
    """Open the folder of a tuning run, new or of the same plan, whose programs are traced for it.

    Raises `OutputError` as `resumable_folder` does.
    """
    return resumable_folder(path, "tuning", plan_identity(plan), "run", elsewhere)


def plan_identity(plan: TuningPlan) -> dict[str, Any]:
    """Return the identity of a run, for which its programs are traced once."""
    return {
        **plan.description,
        "format": FORMAT,
        "parameters": list(plan.space.labels),
        "program": {
            "smooth": plan.smooth.program_identity(differentiated=True),
            "exact": plan.exact.program_identity(),
        },
    }


def write_state(folder: ResumableFolder, state: DescentState) -> None:
    """Store a state from which to resume; raises `OutputError`."""
    folder.write_arrays(CHECKPOINT, _to_arrays(state))


def stored_state(folder: ResumableFolder, plan: TuningPlan) -> DescentState | None:
    """Return the last stored state of a run of this plan, None without one.

    Raises `OutputError` for a damaged or changed file.
    """
    arrays = folder.read_arrays(CHECKPOINT)
    return None if arrays is None else _from_arrays(plan, arrays)


def _to_arrays(state: DescentState) -> dict[str, Any]:
    arrays = {
        "points": state.points,
        "alive": state.alive,
        "best_point": state.best_point,
        "best_loss": np.array(state.best_loss),
        "step": np.array(state.step),
        "trajectories": np.array(state.trajectories),
    }
    leaves = jax.tree.leaves(state.optimiser)
    arrays |= {f"optimiser_{i}": np.asarray(leaf) for i, leaf in enumerate(leaves)}
    for prefix, records, kind in (
        ("step_", state.steps, StepRecord),
        ("validation_", state.validations, ValidationRecord),
    ):
        if records:
            arrays |= {
                prefix + name: np.stack([np.asarray(getattr(record, name)) for record in records])
                for name in kind._fields
            }
    return arrays


def _from_arrays(plan: TuningPlan, arrays: Mapping[str, np.ndarray]) -> DescentState:
    descent: OptimiserSettings = plan.settings.descent
    template: Any = ()
    if not descent.derivative_free:
        transformation = descent.transformation(plan.settings.steps)
        template = jax.vmap(transformation.init)(jnp.asarray(arrays["points"]))
    structure = jax.tree.structure(template)
    leaves = [jnp.asarray(arrays[f"optimiser_{i}"]) for i in range(structure.num_leaves)]
    return DescentState(
        arrays["points"],
        arrays["alive"],
        jax.tree.unflatten(structure, leaves),
        arrays["best_point"],
        float(arrays["best_loss"]),
        int(arrays["step"]),
        float(arrays["trajectories"]),
        _records(arrays, "step_", StepRecord),
        _records(arrays, "validation_", ValidationRecord),
    )


def _records(arrays: Mapping[str, np.ndarray], prefix: str, kind) -> list:
    if prefix + kind._fields[0] not in arrays:
        return []
    columns = [arrays[prefix + name] for name in kind._fields]
    return [kind(*(_own(entry) for entry in row)) for row in zip(*columns, strict=True)]


def _own(value: Any) -> Any:
    """Return plain numbers where a record has plain numbers."""
    return value.item() if np.ndim(value) == 0 else np.asarray(value)


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
