"""Control laws: which torque to command, given the state."""

from jaxsat.control.controller import AbstractBacksteppingLaw, AbstractController, Coast
from jaxsat.control.internal_model import InternalModel, OscillatorState
from jaxsat.control.rate import RateLaw
from jaxsat.control.switching import AbstractSampledController, SwitchingLaw
from jaxsat.control.three_axis import ThreeAxisLaw

__all__ = [
    "AbstractBacksteppingLaw",
    "AbstractController",
    "AbstractSampledController",
    "Coast",
    "InternalModel",
    "OscillatorState",
    "RateLaw",
    "SwitchingLaw",
    "ThreeAxisLaw",
]
