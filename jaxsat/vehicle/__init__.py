"""The spacecraft: its inertia, its thrusters and what is left of them after failures."""

from jaxsat.vehicle.actuators import (
    AbstractActuators,
    AbstractSmoothActuators,
    ActuatorContext,
    Actuators,
)
from jaxsat.vehicle.allocation import LeastPropellant
from jaxsat.vehicle.failures import FailureEvents, FailureKind
from jaxsat.vehicle.modulation import (
    AbstractModulation,
    DeltaSigma,
    IdealThrottle,
    Pulses,
    PulseWidth,
    PulseWidthPulseFrequency,
)
from jaxsat.vehicle.pulsed_actuators import (
    AbstractPulsedActuators,
    Hold,
    PulsedThrusters,
    Usage,
)
from jaxsat.vehicle.sensors import DrawnSensors, Sensors
from jaxsat.vehicle.spacecraft import Spacecraft
from jaxsat.vehicle.thruster_set import ThrusterSet
from jaxsat.vehicle.thrusters import (
    Thrusters,
    allocation,
    one_thruster_coupling,
    two_thruster_coupling,
)

__all__ = [
    "AbstractActuators",
    "AbstractModulation",
    "AbstractPulsedActuators",
    "AbstractSmoothActuators",
    "ActuatorContext",
    "Actuators",
    "DeltaSigma",
    "DrawnSensors",
    "FailureEvents",
    "FailureKind",
    "Hold",
    "IdealThrottle",
    "LeastPropellant",
    "PulseWidth",
    "PulseWidthPulseFrequency",
    "PulsedThrusters",
    "Pulses",
    "Sensors",
    "Spacecraft",
    "ThrusterSet",
    "Thrusters",
    "Usage",
    "allocation",
    "one_thruster_coupling",
    "two_thruster_coupling",
]
