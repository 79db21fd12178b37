"""Fault detection and isolation of thrusters, from estimated rates and commanded on-times alone."""

from jaxsat.diagnosis.cusum import average_run_length, cusum_threshold
from jaxsat.diagnosis.diagnosis import WEAK, Diagnosis, DiagnosisMemory, Stage
from jaxsat.diagnosis.isolation import DiagnosedKind
from jaxsat.diagnosis.residual import Condition, ResidualFilter, ResidualMemory
from jaxsat.diagnosis.thruster_model import ThrusterModel

__all__ = [
    "WEAK",
    "Condition",
    "DiagnosedKind",
    "Diagnosis",
    "DiagnosisMemory",
    "ResidualFilter",
    "ResidualMemory",
    "Stage",
    "ThrusterModel",
    "average_run_length",
    "cusum_threshold",
]
