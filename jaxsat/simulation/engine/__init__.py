"""Engines: how the cases of a closed loop are run together, and what comes out of each."""

from jaxsat.compiler import CannotLower
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import FixedStepper, SampledStepper
from jaxsat.simulation.engine.interface import (
    AbstractEngine,
    CostGradient,
    Mode,
    Replay,
    program_identity,
)
from jaxsat.simulation.engine.nan_in_run import NanInRun, nan_in_run
from jaxsat.simulation.engine.native import NativeEngine, native_obstacle
from jaxsat.simulation.engine.program import (
    AbstractCaseFactory,
    Case,
    Program,
    observations_per_save,
    program_of,
)
from jaxsat.simulation.engine.progress import AttitudeCost, Outputs, RunningCost, Unsettled
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.engine.single import fly
from jaxsat.simulation.engine.stepper import AbstractStepper

__all__ = [
    "AbstractCaseFactory",
    "AbstractEngine",
    "AbstractStepper",
    "AdaptiveStepper",
    "AttitudeCost",
    "CannotLower",
    "Case",
    "CostGradient",
    "FixedStepper",
    "Mode",
    "NanInRun",
    "NativeEngine",
    "Outputs",
    "Program",
    "ReferenceEngine",
    "Replay",
    "RunningCost",
    "SampledStepper",
    "ScanEngine",
    "Tolerance",
    "Unsettled",
    "fly",
    "nan_in_run",
    "native_obstacle",
    "observations_per_save",
    "program_identity",
    "program_of",
]
