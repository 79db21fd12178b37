"""Results as labelled arrays with units, and the folders that hold them.

What needs xarray, which takes its time, is imported when first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from jaxsat.store.files import OutputError, refuse_existing, save_file
from jaxsat.store.folder import OutputFolder
from jaxsat.store.provenance import command_line, machine, provenance
from jaxsat.store.resumable import ResumableFolder

if TYPE_CHECKING:
    from jaxsat.store.chunks import Column
    from jaxsat.store.dataset import (
        dataset_bytes,
        is_within,
        open_trajectory,
        time_at_rest,
        time_to_settle,
        trajectory_dataset,
    )
    from jaxsat.store.ledger import study_columns
    from jaxsat.store.store import StudyStore
    from jaxsat.store.tables import case_table, open_study, save_case_table

_LATER = {
    "Column": "chunks",
    "StudyStore": "store",
    "case_table": "tables",
    "dataset_bytes": "dataset",
    "is_within": "dataset",
    "open_study": "tables",
    "open_trajectory": "dataset",
    "save_case_table": "tables",
    "study_columns": "ledger",
    "time_at_rest": "dataset",
    "time_to_settle": "dataset",
    "trajectory_dataset": "dataset",
}

__all__ = [
    "Column",
    "OutputError",
    "OutputFolder",
    "ResumableFolder",
    "StudyStore",
    "case_table",
    "command_line",
    "dataset_bytes",
    "is_within",
    "machine",
    "open_study",
    "open_trajectory",
    "provenance",
    "refuse_existing",
    "save_case_table",
    "save_file",
    "study_columns",
    "time_at_rest",
    "time_to_settle",
    "trajectory_dataset",
]


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'jaxsat.store' has no attribute {name!r}")
    return getattr(importlib.import_module(f"jaxsat.store.{_LATER[name]}"), name)


def __dir__() -> list[str]:
    return __all__
