"""Fault detection and isolation of thrusters and wheels, from estimates, readings and commands."""

from jaxsat.diagnosis.cusum import average_run_length, cusum_threshold
from jaxsat.diagnosis.diagnosis import MOST_RETURNS, WEAK, Diagnosis, DiagnosisMemory, Stage
from jaxsat.diagnosis.hypotheses import DiagnosedKind
from jaxsat.diagnosis.residual import (
    AbstractResidualFilter,
    Condition,
    ResidualFilter,
    ResidualMemory,
)
from jaxsat.diagnosis.thruster_model import ThrusterModel
from jaxsat.diagnosis.wheel_filter import WheelFilter, WheelMemory

__all__ = [
    "MOST_RETURNS",
    "WEAK",
    "AbstractResidualFilter",
    "Condition",
    "DiagnosedKind",
    "Diagnosis",
    "DiagnosisMemory",
    "ResidualFilter",
    "ResidualMemory",
    "Stage",
    "ThrusterModel",
    "WheelFilter",
    "WheelMemory",
    "average_run_length",
    "cusum_threshold",
]
