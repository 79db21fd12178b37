"""Closed loops and how they are integrated."""

from jaxsat.simulation.assessment import Assessment
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.integration_error import IntegrationError
from jaxsat.simulation.loops import (
    AbstractContinuousLoop,
    AbstractLoop,
    ContinuousLoop,
    Motion,
)
from jaxsat.simulation.methods import Method, adaptive, default_method, fixed, step_size_for
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.solve import simulate
from jaxsat.simulation.trajectory import Outcome, Signals, Trajectory

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
