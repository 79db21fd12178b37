"""Fault detection and isolation of thrusters and wheels, from estimates, readings and commands."""

from jaxsat.control.diagnosis.diagnosis import cusum_threshold as cusum_threshold
