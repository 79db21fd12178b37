"""Closed loops and how they are integrated."""

from jaxsat.simulation.loops import (
    AbstractContinuousLoop,
    AbstractLoop,
    ContinuousLoop,
    ErrorCoordinateLoop,
    SampledLoop,
)
from jaxsat.simulation.methods import Method, adaptive, default_method, fixed
from jaxsat.simulation.solve import simulate
from jaxsat.simulation.trajectory import Outcome, Signals, Trajectory

__all__ = [
    "AbstractContinuousLoop",
    "AbstractLoop",
    "ContinuousLoop",
    "ErrorCoordinateLoop",
    "Method",
    "Outcome",
    "SampledLoop",
    "Signals",
    "Trajectory",
    "adaptive",
    "default_method",
    "fixed",
    "simulate",
]
