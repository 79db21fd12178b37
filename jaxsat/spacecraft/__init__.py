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
    PluginActuators,
)
from jaxsat.spacecraft.allocation import Allocated, allocate, allocate_unloading
from jaxsat.spacecraft.distribution import AbstractDistribution, Direct, WheelsFirst
from jaxsat.spacecraft.effector import (
    AbstractEffector,
    Effect,
    EffectorContext,
    Reach,
)
from jaxsat.spacecraft.failures import (
    AbstractFailures,
    FailureEvents,
)
from jaxsat.spacecraft.gimbals import (
    ControlMomentGyros,
    GimbalFailures,
    GyroStates,
)
from jaxsat.spacecraft.held_effector import Hold, hold_by_hold, mean_size
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
from jaxsat.spacecraft.relief import Relief
from jaxsat.spacecraft.sensors import DrawnSensors, Sensors, Tachometers
from jaxsat.spacecraft.spacecraft import Spacecraft, inverse_of
from jaxsat.spacecraft.thrusters import (
    Thrusters,
    ThrusterSet,
    one_thruster_coupling,
    two_thruster_coupling,
)
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum

__all__ = [
    "AbstractActuators",
    "AbstractDistribution",
    "AbstractEffector",
    "AbstractFailures",
    "AbstractModulation",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "Allocated",
    "ControlMomentGyros",
    "DeltaSigma",
    "Direct",
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
    "PluginActuators",
    "PulseWidth",
    "PulseWidthPulseFrequency",
    "PulsedThrusters",
    "Pulses",
    "Reach",
    "Relief",
    "Sensors",
    "Spacecraft",
    "StarTracker",
    "Tachometers",
    "ThrusterSet",
    "Thrusters",
    "WheelFailureKind",
    "WheelFailures",
    "WheelMomenta",
    "Wheels",
    "WheelsFirst",
    "allocate",
    "allocate_unloading",
    "hold_by_hold",
    "inverse_of",
    "mean_size",
    "one_thruster_coupling",
    "two_thruster_coupling",
    "wheel_momentum",
]
