"""What surrounds the spacecraft: its orbit and the torques that disturb it."""

from jaxsat.core.earth import circular_orbit_rate
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance,
    ConstantTorque,
    DisturbanceContext,
    GravityGradient,
    NoDisturbance,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.spacecraft.environment.orbit import (
    AbstractOrbit,
    CircularOrbit,
    DipoleField,
    ExactOrbit,
    SmallAngleOrbit,
)
from jaxsat.spacecraft.environment.orbital_torques import (
    AerodynamicTorque,
    MagneticTorque,
    SolarPressureTorque,
    Sunlight,
)
from jaxsat.spacecraft.environment.panels import PanelDrag, Panels, PanelSolarPressure

__all__ = [
    "AbstractDisturbance",
    "AbstractOrbit",
    "AerodynamicTorque",
    "CircularOrbit",
    "ConstantTorque",
    "DipoleField",
    "DisturbanceContext",
    "ExactOrbit",
    "GravityGradient",
    "MagneticTorque",
    "NoDisturbance",
    "PanelDrag",
    "PanelSolarPressure",
    "Panels",
    "PeriodicTorque",
    "SmallAngleOrbit",
    "SolarPressureTorque",
    "SumOfDisturbances",
    "Sunlight",
    "circular_orbit_rate",
]
