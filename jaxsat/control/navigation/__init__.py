"""Navigation for sampled laws: estimators, and sensors with a state."""

from jaxsat.control.navigation.dynamics_filter import DynamicsFilter as DynamicsFilter
from jaxsat.control.navigation.dynamics_filter import TorqueModel as TorqueModel
from jaxsat.control.navigation.estimator import AbstractEstimator as AbstractEstimator
from jaxsat.control.navigation.estimator import Estimate as Estimate
from jaxsat.control.navigation.estimator import EstimatorContext as EstimatorContext
from jaxsat.control.navigation.estimator import Measurement as Measurement
from jaxsat.control.navigation.estimator import difference as difference
from jaxsat.control.navigation.estimator import towards as towards
from jaxsat.control.navigation.mekf import MultiplicativeFilter as MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation as Navigation
