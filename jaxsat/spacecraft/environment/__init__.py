"""What surrounds the spacecraft: its orbit and the torques that disturb it."""

from jaxsat.spacecraft.environment.disturbances import PeriodicTorque as PeriodicTorque
from jaxsat.spacecraft.environment.orbit import AbstractOrbit as AbstractOrbit
from jaxsat.spacecraft.environment.orbit import SmallAngleOrbit as SmallAngleOrbit
