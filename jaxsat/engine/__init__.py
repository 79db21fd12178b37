"""Engines: how the cases of a closed loop are run together, and what comes out of each."""

from jaxsat.compiler import CannotLower
from jaxsat.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.engine.fixed import FixedStepper, SampledStepper
from jaxsat.engine.interface import AbstractEngine, CostGradient, Mode, Replay, program_identity
from jaxsat.engine.nan_in_run import NanInRun, nan_in_run
from jaxsat.engine.native import NativeEngine, native_obstacle
from jaxsat.engine.program import AbstractCaseFactory, Case, Program, program_of
from jaxsat.engine.progress import AttitudeCost, Outputs, RunningCost, Unsettled
from jaxsat.engine.reference import ReferenceEngine
from jaxsat.engine.scan import ScanEngine
from jaxsat.engine.single import fly
from jaxsat.engine.stepper import AbstractStepper

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
    "program_identity",
    "program_of",
]
