"""The spacecraft: its inertia, thrusters, what is left of them after failures, and sensors."""

from jaxsat.vehicle.actuators import (
    AbstractActuators,
    AbstractSmoothActuators,
    ActuatorContext,
    Actuators,
)
from jaxsat.vehicle.gyro import Gyro
from jaxsat.vehicle.sensors import DrawnSensors, Sensors
from jaxsat.vehicle.spacecraft import Spacecraft
from jaxsat.vehicle.star_tracker import StarTracker
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
    "Gyro",
    "Sensors",
    "Spacecraft",
    "StarTracker",
    "Thrusters",
    "allocation",
    "one_thruster_coupling",
    "two_thruster_coupling",
]
