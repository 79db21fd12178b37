"""The spacecraft: its inertia, its thrusters and what is left of them after failures."""

from jaxsat.vehicle.actuators import (
    AbstractActuators,
    AbstractSmoothActuators,
    ActuatorContext,
    Actuators,
)
from jaxsat.vehicle.sensors import DrawnSensors, Sensors
from jaxsat.vehicle.spacecraft import Spacecraft
from jaxsat.vehicle.thrusters import (
    Thrusters,
    allocation,
    one_thruster_coupling,
    two_thruster_coupling,
)

__all__ = [
    "AbstractActuators",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "DrawnSensors",
    "Sensors",
    "Spacecraft",
    "Thrusters",
    "allocation",
    "one_thruster_coupling",
    "two_thruster_coupling",
]
