"""The spacecraft: its inertia, its thrusters, what is left of them after failures, its wheels."""

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
from jaxsat.vehicle.wheel_actuators import ActuatorsWithWheels
from jaxsat.vehicle.wheels import WheelPiece, Wheels

__all__ = [
    "AbstractActuators",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "ActuatorsWithWheels",
    "DrawnSensors",
    "Sensors",
    "Spacecraft",
    "Thrusters",
    "WheelPiece",
    "Wheels",
    "allocation",
    "one_thruster_coupling",
    "two_thruster_coupling",
]
