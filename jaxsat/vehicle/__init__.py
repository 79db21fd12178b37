"""The spacecraft: inertia, thrusters and what is left of them after failures, wheels,
magnetorquers, sensors."""

from jaxsat.vehicle.actuators import (
    AbstractActuators,
    AbstractSmoothActuators,
    ActuatorContext,
    Actuators,
    NoThrusters,
)
from jaxsat.vehicle.allocation import LeastPropellant
from jaxsat.vehicle.bounded_least_squares import nearest_within
from jaxsat.vehicle.failures import (
    AbstractFailures,
    FailureEvents,
    FailureKind,
    MagnetorquerFailures,
)
from jaxsat.vehicle.gyro import Gyro
from jaxsat.vehicle.holds import AbstractPulsedActuators, Consumption, Hold, Usage
from jaxsat.vehicle.magnetorquers import Magnetorquers
from jaxsat.vehicle.modulation import (
    AbstractModulation,
    DeltaSigma,
    IdealThrottle,
    Pulses,
    PulseWidth,
    PulseWidthPulseFrequency,
)
from jaxsat.vehicle.pulsed_thrusters import PulsedThrusters
from jaxsat.vehicle.sensors import DrawnSensors, Sensors
from jaxsat.vehicle.spacecraft import Spacecraft, inverse_of
from jaxsat.vehicle.star_tracker import StarTracker
from jaxsat.vehicle.tachometers import Tachometers
from jaxsat.vehicle.thruster_set import ThrusterSet
from jaxsat.vehicle.thrusters import (
    Thrusters,
    allocation,
    one_thruster_coupling,
    two_thruster_coupling,
)
from jaxsat.vehicle.wheel_actuators import (
    ActuatorsWithWheels,
    PulsedActuatorsWithWheels,
    WheelDrives,
)
from jaxsat.vehicle.wheel_failures import WheelFailureKind, WheelFailures
from jaxsat.vehicle.wheel_piece import WheelPiece
from jaxsat.vehicle.wheel_states import WheelStates, first_states
from jaxsat.vehicle.wheels import Wheels

__all__ = [
    "AbstractActuators",
    "AbstractFailures",
    "AbstractModulation",
    "AbstractPulsedActuators",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "ActuatorsWithWheels",
    "Consumption",
    "DeltaSigma",
    "DrawnSensors",
    "FailureEvents",
    "FailureKind",
    "Gyro",
    "Hold",
    "IdealThrottle",
    "LeastPropellant",
    "MagnetorquerFailures",
    "Magnetorquers",
    "NoThrusters",
    "PulseWidth",
    "PulseWidthPulseFrequency",
    "PulsedActuatorsWithWheels",
    "PulsedThrusters",
    "Pulses",
    "Sensors",
    "Spacecraft",
    "StarTracker",
    "Tachometers",
    "ThrusterSet",
    "Thrusters",
    "Usage",
    "WheelDrives",
    "WheelFailureKind",
    "WheelFailures",
    "WheelPiece",
    "WheelStates",
    "Wheels",
    "allocation",
    "first_states",
    "inverse_of",
    "nearest_within",
    "one_thruster_coupling",
    "two_thruster_coupling",
]
