"""What surrounds the spacecraft: its orbit and the torques that disturb it."""

from jaxsat.environment.disturbances import (
    AbstractDisturbance,
    ConstantTorque,
    DisturbanceContext,
    GravityGradient,
    NoDisturbance,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.environment.orbit import (
    AbstractOrbit,
    ExactOrbit,
    SmallAngleOrbit,
    circular_orbit_rate,
)

__all__ = [
    "AbstractDisturbance",
    "AbstractOrbit",
    "ConstantTorque",
    "DisturbanceContext",
    "ExactOrbit",
    "GravityGradient",
    "NoDisturbance",
    "PeriodicTorque",
    "SmallAngleOrbit",
    "SumOfDisturbances",
    "circular_orbit_rate",
]
