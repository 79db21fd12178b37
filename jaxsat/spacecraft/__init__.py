"""The spacecraft: inertia, thrusters and what is left of them after failures, wheels,
magnetorquers, sensors."""

from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.gimbals import GimbalFailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.spacecraft.actuators import (
    AbstractActuators,
    AbstractSmoothActuators,
    ActuatorContext,
    Actuators,
    NoThrusters,
)
from jaxsat.spacecraft.allocation import Allocated, allocate
from jaxsat.spacecraft.effector import AbstractEffector, Effect, EffectorContext, Reach
from jaxsat.spacecraft.failures import (
    AbstractFailures,
    FailureEvents,
)
from jaxsat.spacecraft.gimbals import (
    ControlMomentGyros,
    GimbalFailures,
    GyroStates,
)
from jaxsat.spacecraft.holds import AbstractPulsedActuators, Consumption, Hold, Usage
from jaxsat.spacecraft.least_propellant import LeastPropellant
from jaxsat.spacecraft.magnetorquers import MagnetorquerFailures, Magnetorquers
from jaxsat.spacecraft.modulation import (
    AbstractModulation,
    DeltaSigma,
    IdealThrottle,
    Pulses,
    PulseWidth,
    PulseWidthPulseFrequency,
)
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.sensors import DrawnSensors, Sensors, Tachometers
from jaxsat.spacecraft.spacecraft import Spacecraft, inverse_of
from jaxsat.spacecraft.thrusters import (
    Thrusters,
    ThrusterSet,
    one_thruster_coupling,
    two_thruster_coupling,
)
from jaxsat.spacecraft.wheel_actuators import (
    ActuatorsWithWheels,
    PulsedActuatorsWithWheels,
    WheelDrives,
)
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum

__all__ = [
    "AbstractActuators",
    "AbstractEffector",
    "AbstractFailures",
    "AbstractModulation",
    "AbstractPulsedActuators",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "ActuatorsWithWheels",
    "Allocated",
    "Consumption",
    "ControlMomentGyros",
    "DeltaSigma",
    "DrawnSensors",
    "Effect",
    "EffectorContext",
    "FailureEvents",
    "FailureKind",
    "GimbalFailureKind",
    "GimbalFailures",
    "Gyro",
    "GyroStates",
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
    "Reach",
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
    "WheelMomenta",
    "Wheels",
    "allocate",
    "inverse_of",
    "one_thruster_coupling",
    "two_thruster_coupling",
    "wheel_momentum",
]
