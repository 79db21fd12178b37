"""From what sensors measure to what a sampled law is told: estimators, and sensors with a state."""

from jaxsat.control.navigation.estimator import (
    AbstractEstimator,
    Estimate,
    EstimatorContext,
    Measurement,
    RawMeasurements,
    difference,
)
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation, NavigationState, Told

__all__ = [
    "AbstractEstimator",
    "Estimate",
    "EstimatorContext",
    "Measurement",
    "MultiplicativeFilter",
    "Navigation",
    "NavigationState",
    "RawMeasurements",
    "Told",
    "difference",
]
