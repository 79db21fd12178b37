"""The environment of the spacecraft: orbit, magnetic field and disturbance torques."""

from jaxsat.spacecraft.environment.disturbances import PeriodicTorque as PeriodicTorque
from jaxsat.spacecraft.environment.orbit import AbstractOrbit as AbstractOrbit
from jaxsat.spacecraft.environment.orbit import SmallAngleOrbit as SmallAngleOrbit
