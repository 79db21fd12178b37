"""From what sensors measure to what a sampled law is told: estimators, and sensors with a state."""

from jaxsat.navigation.estimator import (
    AbstractEstimator,
    Estimate,
    EstimatorContext,
    Measurement,
    RawMeasurements,
)
from jaxsat.navigation.mekf import MultiplicativeFilter
from jaxsat.navigation.navigation import Navigation, NavigationState, Told
from jaxsat.navigation.rotations import difference

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
