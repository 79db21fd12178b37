"""A run on disk: a folder that it is gone on with in, whose files are replaced whole."""

import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.results import OutputError, machine
from jaxsat.results.locking import lock_folder
from jaxsat.results.store import differences
from jaxsat.tuning.descent import DescentState, StepRecord, ValidationRecord, begin
from jaxsat.tuning.optimisers import Descent
from jaxsat.tuning.plan import TuningPlan

CHECKPOINT = "checkpoint.npz"
FORMAT = 1


class TuningFolder:
    """The folder of one tuning run, open for writing by this process alone.

    `identity` is all that the run depends on, as plain data. A folder that is not there is made;
    one that holds the same run is gone on with. Raises `OutputError` for one that holds another run
    or anything else, that another process writes to, or (unless `elsewhere`) that was begun with
    other versions or on another processor, where the bits may differ.
    """

    def __init__(self, path: str | Path, identity: Mapping[str, Any], *, elsewhere: bool = False):
        self.path = Path(path)
        self._identity = json.loads(json.dumps(identity))
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.path} cannot be made: {error.strerror or error}.") from error
        self._lock = lock_folder(self.path)
        try:
            self._arrays = self._read(elsewhere)
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> "TuningFolder":
        """The folder itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Let other processes write."""
        self._lock.close()

    def has(self, name: str) -> bool:
        """Whether a result has been written."""
        return (self.path / name).exists()

    def state(self, plan: TuningPlan) -> DescentState:
        """Where the run is: the state last kept, or its first one."""
        return begin(plan) if self._arrays is None else _from_arrays(plan, self._arrays)

    def keep(self, state: DescentState) -> None:
        """Keep a state to go on from."""
        arrays = _to_arrays(state)
        about = {"format": FORMAT, "identity": self._identity, "machine": machine()}
        buffer = io.BytesIO()
        np.savez(buffer, **(arrays | {"about": np.array(json.dumps(about))}))  # pyright: ignore
        self.write(CHECKPOINT, buffer.getvalue())

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file, or replace it, in one step."""
        data = content.encode() if isinstance(content, str) else content
        partial = self.path / f".{name}.partial"
        try:
            with partial.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(self.path / name)
        except OSError as error:
            partial.unlink(missing_ok=True)
            raise OutputError(
                f"{self.path / name} cannot be written: {error.strerror or error}. What was kept "
                "before is good; the same command goes on from there."
            ) from error

    def _read(self, elsewhere: bool) -> dict[str, np.ndarray] | None:
        file = self.path / CHECKPOINT
        if not file.exists():
            others = [e.name for e in self.path.iterdir() if not e.name.endswith(".partial")]
            if others:
                raise OutputError(
                    f"{self.path} holds what jaxsat did not write ({', '.join(others[:3])}); "
                    "give another folder."
                )
            return None
        try:
            with np.load(file) as stored:
                arrays = dict(stored)
            about = json.loads(str(arrays.pop("about")))
        except (OSError, ValueError, KeyError) as error:
            raise OutputError(
                f"{file} is no state of a tuning run; give another folder."
            ) from error
        if about["format"] != FORMAT:
            raise OutputError(f"{file} is of another version; give another folder.")
        other = differences(about["identity"], self._identity)
        if other:
            raise OutputError(
                f"{self.path} holds another run ({'; '.join(other)}); give another folder."
            )
        other = differences(about["machine"], machine())
        if other and not elsewhere:
            raise OutputError(
                f"{self.path} was written under other conditions ({'; '.join(other)}), so the run "
                "would not be the one that was begun; allow that explicitly or give another folder."
            )
        return arrays


def plan_identity(plan: TuningPlan) -> dict[str, Any]:
    """What tells runs apart."""
    return {**plan.description, "parameters": list(plan.space.labels)}


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
    descent: Descent = plan.settings.descent
    made = descent.transformation(plan.settings.steps)
    template = jax.vmap(made.init)(jnp.asarray(arrays["points"]))
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
    """Plain numbers where a record has plain numbers."""
    return value.item() if np.ndim(value) == 0 else np.asarray(value)
