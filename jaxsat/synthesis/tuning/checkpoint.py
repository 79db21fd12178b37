"""Folder of a tuning run, in which it is resumed; files are replaced atomically."""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.store.files import OutputError
from jaxsat.store.header import differences
from jaxsat.store.provenance import machine
from jaxsat.store.resumable import ResumableFolder
from jaxsat.synthesis.execution import resumable_folder
from jaxsat.synthesis.tuning.descent import (
    DescentState,
    StepRecord,
    ValidationRecord,
    initial_state,
)
from jaxsat.synthesis.tuning.plan import TuningPlan

CHECKPOINT = "checkpoint.npz"
FORMAT = 2

_DECODING = (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile)


class TuningFolder:
    """The folder of one tuning run, open for writing by this process alone.

    `identity` is all that the run depends on, as plain data. A missing folder is created; one of
    the same run is resumed. Raises `OutputError` for a folder that holds another run or anything
    else, that another process writes to, in which a file was damaged or changed, or (unless
    `elsewhere`) that was begun with other versions or on another processor, where the bits may
    differ.
    """

    files: ResumableFolder
    """The folder of the run's results."""

    def __init__(self, path: str | Path, identity: Mapping[str, Any], *, elsewhere: bool = False):
        self.files = resumable_folder(path, "tuning", identity, "run")
        try:
            self._arrays = self._read(elsewhere)
        except BaseException:
            self.files.close()
            raise

    def __enter__(self) -> "TuningFolder":
        return self

    def __exit__(self, *exception: Any) -> None:
        """Release the folder for other processes."""
        self.files.__exit__(*exception)

    @property
    def lost_state(self) -> bool:
        """Whether a state that was written is missing, so that the run begins again."""
        return self._arrays is None and self.files.is_begun

    def state(self, plan: TuningPlan) -> DescentState:
        """Return the last stored state of the run, or its first one.

        Raises `OutputError` for a state of another plan.
        """
        if self._arrays is None:
            return initial_state(plan)
        try:
            state = _from_arrays(plan, self._arrays)
            _check(plan, state)
        except _DECODING as error:
            raise self._no_state() from error
        return state

    def keep(self, state: DescentState) -> None:
        """Store a state from which to resume."""
        about = {"format": FORMAT, "machine": machine()}
        buffer = io.BytesIO()
        arrays = _to_arrays(state) | {"about": np.array(json.dumps(about))}
        np.savez(buffer, **arrays)  # pyright: ignore
        self.files.write(CHECKPOINT, buffer.getvalue())

    def _read(self, elsewhere: bool) -> dict[str, np.ndarray] | None:
        content = self.files.read(CHECKPOINT)
        if content is None:
            return None
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as archive:
                arrays = dict(archive)
            about = json.loads(str(arrays.pop("about")))
            if about["format"] != FORMAT:
                raise ValueError("another version's")
            other = differences(about["machine"], machine())
        except _DECODING as error:
            raise self._no_state() from error
        if other and not elsewhere:
            raise OutputError(
                f"{self.files.path} was written under other conditions ({'; '.join(other)}), so "
                "the run would not be the one that was begun; allow that explicitly or give "
                "another folder.",
                elsewhere=True,
            )
        return arrays

    def _no_state(self) -> OutputError:
        return OutputError(
            f"{self.files.path / CHECKPOINT} is no state of this tuning run; give another folder."
        )


def plan_identity(plan: TuningPlan) -> dict[str, Any]:
    """Return the identity of a run, for which its programs are traced once."""
    return {
        **plan.description,
        "parameters": list(plan.space.labels),
        "program": {
            "smooth": plan.smooth.program_identity(differentiated=True),
            "exact": plan.exact.program_identity(),
        },
    }


def _to_arrays(state: DescentState) -> dict[str, np.ndarray]:
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
    if _kinds(leaves) != _kinds(jax.tree.leaves(template)):
        raise ValueError("The optimiser's state must have the shapes that it begins with.")
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


def _check(plan: TuningPlan, state: DescentState) -> None:
    """Raise `ValueError` for a state that the plan cannot have."""
    starts, size = state.points.shape
    good = (
        starts == plan.settings.starts
        and size == plan.space.size
        and state.alive.shape == (starts,)
        and state.alive.dtype == bool
        and state.alive.any()
        and state.best_point.shape == (size,)
        and np.isfinite(state.points).all()
        and np.isfinite(state.best_point).all()
        and not np.isnan(state.best_loss)
        and 0 <= state.step <= plan.settings.steps
        and 0 <= state.trajectories < np.inf
        and len(state.steps) == state.step
        and len(state.validations) > 0
        and all(record.points.shape == (starts, size) for record in state.steps)
        and all(record.loss.shape == (starts,) for record in state.validations)
    )
    if not good:
        raise ValueError("The state must be one of the plan's.")


def _kinds(arrays: list[Any]) -> list[tuple]:
    return [(array.shape, array.dtype) for array in arrays]


def _records(arrays: Mapping[str, np.ndarray], prefix: str, kind) -> list:
    if prefix + kind._fields[0] not in arrays:
        return []
    columns = [arrays[prefix + name] for name in kind._fields]
    return [kind(*(_own(entry) for entry in row)) for row in zip(*columns, strict=True)]


def _own(value: Any) -> Any:
    """Return plain numbers where a record has plain numbers."""
    return value.item() if np.ndim(value) == 0 else np.asarray(value)
