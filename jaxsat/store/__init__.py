"""Results as labelled arrays with units, and their folders.

Xarray, which is slow to import, is imported at first use.
"""

import importlib
from typing import Any

_LATER = {"open_study": "tables", "time_to_settle": "dataset", "trajectory_dataset": "dataset"}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'jaxsat.store' has no attribute {name!r}")
    return getattr(importlib.import_module(f"jaxsat.store.{_LATER[name]}"), name)
