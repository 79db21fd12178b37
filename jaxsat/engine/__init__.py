"""Engines: how many copies of a closed loop are run at once, and what comes out of each."""

from jaxsat.engine.adaptive import Tolerance
from jaxsat.engine.fingerprint import program_identity
from jaxsat.engine.interface import AbstractEngine, CostGradient, Mode, Replay
from jaxsat.engine.native import CannotLower, NativeEngine, native_obstacle
from jaxsat.engine.program import AbstractCopies, Copy, Program, program_of
from jaxsat.engine.progress import AttitudeCost, Outputs, RunningCost, Unsettled
from jaxsat.engine.reference import ReferenceEngine
from jaxsat.engine.scan import ScanEngine

__all__ = [
    "AbstractCopies",
    "AbstractEngine",
    "AttitudeCost",
    "CannotLower",
    "Copy",
    "CostGradient",
    "Mode",
    "NativeEngine",
    "Outputs",
    "Program",
    "ReferenceEngine",
    "Replay",
    "RunningCost",
    "ScanEngine",
    "Tolerance",
    "Unsettled",
    "native_obstacle",
    "program_identity",
    "program_of",
]
