"""Fault detection and isolation of thrusters and wheels, from estimates, readings and commands."""

from jaxsat.control.diagnosis.diagnosis import (
    MOST_RETURNS,
    WEAK,
    Diagnosis,
    DiagnosisMemory,
    Stage,
    average_run_length,
    cusum_threshold,
    false_alarm_rate,
)
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import (
    AbstractResidualFilter,
    ActuatorCondition,
    Reading,
    momentum_with_rotors,
)
from jaxsat.control.diagnosis.thruster_filter import ThrusterFilter, ThrusterModel
from jaxsat.control.diagnosis.wheel_filter import WheelFilter

__all__ = [
    "MOST_RETURNS",
    "WEAK",
    "AbstractResidualFilter",
    "ActuatorCondition",
    "DiagnosedKind",
    "Diagnosis",
    "DiagnosisMemory",
    "Reading",
    "Stage",
    "ThrusterFilter",
    "ThrusterModel",
    "WheelFilter",
    "average_run_length",
    "cusum_threshold",
    "false_alarm_rate",
    "momentum_with_rotors",
]
