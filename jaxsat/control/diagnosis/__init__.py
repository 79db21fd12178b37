"""Fault detection and isolation of thrusters and wheels, from estimates, readings and commands."""

from jaxsat.control.diagnosis.diagnosis import (
    MOST_RETURNS,
    WEAK,
    Diagnosis,
    DiagnosisMemory,
    Stage,
    average_run_length,
    cusum_threshold,
)
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import AbstractResidualFilter, ActuatorCondition
from jaxsat.control.diagnosis.thruster_filter import ResidualFilter, ResidualMemory, ThrusterModel
from jaxsat.control.diagnosis.wheel_filter import WheelFilter, WheelMemory

__all__ = [
    "MOST_RETURNS",
    "WEAK",
    "AbstractResidualFilter",
    "ActuatorCondition",
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
