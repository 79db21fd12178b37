"""From what sensors measure to what a sampled law is told: estimators, and sensors with a state."""

from jaxsat.navigation.estimator import (
    AbstractEstimator,
    Estimate,
    Measurement,
    RawMeasurements,
)
from jaxsat.navigation.mekf import MultiplicativeFilter
from jaxsat.navigation.navigation import Navigation, NavigationState, Told

__all__ = [
    "AbstractEstimator",
    "Estimate",
    "Measurement",
    "MultiplicativeFilter",
    "Navigation",
    "NavigationState",
    "RawMeasurements",
    "Told",
]
