"""Controllability of a spacecraft from its inertia and torque axes alone."""

from jaxsat.controllability.actuators import actuator_set as actuator_set
from jaxsat.controllability.judging import judge as judge
from jaxsat.controllability.linear import linear_controllability as linear_controllability
from jaxsat.controllability.rank import analyse as analyse
from jaxsat.controllability.wording import verdict_sentence as verdict_sentence
