"""Control laws: commanded torque as a function of the state."""

from jaxsat.control.controller import AbstractController as AbstractController
from jaxsat.control.controller import AbstractFeedbackLaw as AbstractFeedbackLaw
from jaxsat.control.controller import LawContext as LawContext
from jaxsat.control.inertia_fit import InertiaFit as InertiaFit
from jaxsat.control.inertia_fit import TorqueAxisFrame as TorqueAxisFrame
from jaxsat.control.one_torque import OneTorque as OneTorque
from jaxsat.control.rate import RateLaw as RateLaw
from jaxsat.control.sampled import AbstractSampledController as AbstractSampledController
from jaxsat.control.switching import SwitchingLaw as SwitchingLaw
from jaxsat.control.three_axis import InternalModel as InternalModel
from jaxsat.control.three_axis import ThreeAxisLaw as ThreeAxisLaw
