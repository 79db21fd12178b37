"""Closed loops and how they are integrated.

The engines, which stand above the loops, are imported when `simulate` is first used.
"""

import importlib
from typing import TYPE_CHECKING, Any

from jaxsat.simulation.assessment import Assessment, IntegrationError
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import (
    AbstractContinuousLoop,
    AbstractLoop,
    ContinuousLoop,
    Motion,
)
from jaxsat.simulation.methods import Method, adaptive, default_method, fixed, step_size_for
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Outcome, Signals, Trajectory

if TYPE_CHECKING:
    from jaxsat.simulation.engine.single import simulate

__all__ = [
    "AbstractContinuousLoop",
    "AbstractLoop",
    "Assessment",
    "ContinuousLoop",
    "ErrorCoordinateLoop",
    "IntegrationError",
    "Method",
    "Motion",
    "Outcome",
    "SampledLoop",
    "Signals",
    "Trajectory",
    "adaptive",
    "default_method",
    "fixed",
    "simulate",
    "step_size_for",
]


def __getattr__(name: str) -> Any:
    if name != "simulate":
        raise AttributeError(f"module 'jaxsat.simulation' has no attribute {name!r}")
    return importlib.import_module("jaxsat.simulation.engine.single").simulate
