"""The spacecraft: inertia, thrusters, wheels, gyros, magnetorquers, sensors, their failures."""

from jaxsat.spacecraft.actuators import Actuators as Actuators
from jaxsat.spacecraft.distribution import WheelsFirst as WheelsFirst
from jaxsat.spacecraft.navigation_sensors import Gyro as Gyro
from jaxsat.spacecraft.navigation_sensors import StarTracker as StarTracker
from jaxsat.spacecraft.relief import Relief as Relief
from jaxsat.spacecraft.spacecraft import Spacecraft as Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters as Thrusters
from jaxsat.spacecraft.thrusters import one_thruster_coupling as one_thruster_coupling
from jaxsat.spacecraft.thrusters import two_thruster_coupling as two_thruster_coupling
from jaxsat.spacecraft.vector_sensors import Observation as Observation
from jaxsat.spacecraft.vector_sensors import VectorSensor as VectorSensor
from jaxsat.spacecraft.wheel_failures import WheelFailures as WheelFailures
from jaxsat.spacecraft.wheels import Wheels as Wheels
