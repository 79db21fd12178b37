"""Where the studies of several laws are kept in one folder."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FOLDER = "studies"


def named_store(folder: Path, name: str) -> Path:
    """The store of one study, by the name of its law, which may be a module or a file."""
    return folder / FOLDER / f"{_file_name(name)}.zarr"


def acceptance_store(
    folder: Path, level: str, torque_limit: float, law: str, start: str = "random"
) -> Path:
    """The store of a law on the acceptance set at a level and a torque limit (N m).

    Its cases start at "random", or in the "paper"'s initial state.
    """
    return folder / FOLDER / f"{level}-{torque_limit:g}-{_file_name(law)}-{start}.zarr"


def store_of_row(folder: Path, row: Mapping[str, Any]) -> Path:
    """The store behind a row of a comparison's record, of a scenario or of the acceptance set."""
    if "scenario" in row:
        return named_store(folder, row["law"])
    return acceptance_store(folder, row["level"], row["torque_limit"], row["law"])


def _file_name(name: str) -> str:
    return re.sub(r"[^\w.-]+", "-", name)
