"""Control laws: which torque to command, given the state."""

from jaxsat.control.controller import (
    AbstractBacksteppingLaw,
    AbstractController,
    AbstractFeedbackLaw,
    Coast,
    LawContext,
    UnsuitableModel,
)
from jaxsat.control.demands import AbstractDemand, MorinSamson, TwoChannel
from jaxsat.control.estimators import ThirdAxis, ThirdAxisEstimator
from jaxsat.control.fine import FineStage, OscillatorySettling
from jaxsat.control.finite_time_rate import FiniteTimeRate, FiniteTimeRateLaw
from jaxsat.control.handover import Handover
from jaxsat.control.inertia_fit import InertiaFit, TorqueAxisFrame
from jaxsat.control.least_squares import RecursiveLeastSquares
from jaxsat.control.normal_form import NormalForm, NormalState
from jaxsat.control.one_torque import OneTorque, OneTorqueMode
from jaxsat.control.oscillatory import Oscillator, OscillatoryLaw
from jaxsat.control.presets import (
    oscillatory_settling,
    ripple_filter,
    three_slew_settling,
)
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.rate import RateLaw
from jaxsat.control.ripple import AbstractRippleEstimator, RippleFilter, RippleObserver
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.slews import SlewPlanner, ThreeSlewLaw
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.switching import SwitchingLaw
from jaxsat.control.three_axis import InternalModel, OscillatorState, ThreeAxisLaw

__all__ = [
    "AbstractBacksteppingLaw",
    "AbstractController",
    "AbstractDemand",
    "AbstractFeedbackLaw",
    "AbstractRippleEstimator",
    "AbstractSampledController",
    "Coast",
    "FineStage",
    "FiniteTimeRate",
    "FiniteTimeRateLaw",
    "Handover",
    "InertiaFit",
    "InternalModel",
    "LawContext",
    "MorinSamson",
    "NormalForm",
    "NormalState",
    "OneTorque",
    "OneTorqueMode",
    "Oscillator",
    "OscillatorState",
    "OscillatoryLaw",
    "OscillatorySettling",
    "QuaternionFeedback",
    "RateLaw",
    "RecursiveLeastSquares",
    "RippleFilter",
    "RippleObserver",
    "SlewPlanner",
    "SwitchingLaw",
    "ThirdAxis",
    "ThirdAxisEstimator",
    "ThreeAxisLaw",
    "ThreeSlewLaw",
    "ThreeSlewSettling",
    "TorqueAxisFrame",
    "TwoChannel",
    "UnsuitableModel",
    "oscillatory_settling",
    "ripple_filter",
    "three_slew_settling",
]
