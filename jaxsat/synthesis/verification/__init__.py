"""Verification of requirements: nominal run, dispersed cases, and failures of actuators."""
