"""Closed loops and their integration.

The engines, which import the loops, are imported when `simulate` is first used.
"""

import importlib
from typing import Any

from jaxsat.simulation.loops import ContinuousLoop as ContinuousLoop


def __getattr__(name: str) -> Any:
    if name != "simulate":
        raise AttributeError(f"module 'jaxsat.simulation' has no attribute {name!r}")
    return importlib.import_module("jaxsat.simulation.engine.single").simulate
