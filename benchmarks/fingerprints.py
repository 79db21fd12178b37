"""What of a result must not depend on how often it was interrupted: hashes by name."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.store.dataset import open_trajectory
from jaxsat.store.tables import open_study

OF_THE_MAKING = ("command", "created", "history")
"""Entries of a record that tell when and by which command it was made."""


def store_fingerprint(path: Path) -> dict[str, str]:
    """Columns of a study."""
    dataset = open_study(path)
    return {str(name): _hash(np.asarray(values)) for name, values in dataset.variables.items()}


def run_fingerprint(path: Path) -> dict[str, str]:
    """Variables of a trajectory, and the scenario as it was run."""
    dataset = open_trajectory(path / "trajectory.nc")
    found = {str(name): _hash(np.asarray(values)) for name, values in dataset.variables.items()}
    return found | {"scenario": _hash((path / "scenario.toml").read_bytes())}


def tuning_fingerprint(path: Path) -> dict[str, str]:
    """Gains and verdict, and the arrays of the last state."""
    with np.load(path / "checkpoint.npz") as stored:
        found = {
            name: _hash(stored[name]) for name in stored.files if stored[name].dtype.kind != "U"
        }
    files = ("tuned.toml", "verdict.json", "receipt.json", "summary.md")
    return found | {name: _hash((path / name).read_bytes()) for name in files}


def comparison_fingerprint(path: Path) -> dict[str, str]:
    """The record without time and command, and every store."""
    record = json.loads((path / "comparison.json").read_text(encoding="utf-8"))
    found = {
        name: _hash(_text(value)) for name, value in record.items() if name not in OF_THE_MAKING
    }
    for store in sorted((path / "studies").iterdir()):
        if not store.name.startswith("."):
            found |= {f"{store.name}/{k}": v for k, v in store_fingerprint(store).items()}
    return found


def _text(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True).encode()


def _hash(content: Any) -> str:
    data = content if isinstance(content, bytes) else np.ascontiguousarray(content).tobytes()
    return hashlib.sha256(data).hexdigest()
