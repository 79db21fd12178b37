"""Differentiable simulator and gain tuner for spacecraft that have lost thrusters."""

__version__ = "0.1.0"
