"""Engines that run the cases of a closed loop together, and the outputs of each case."""

from jaxsat.simulation.engine.fixed import FixedStepper as FixedStepper
from jaxsat.simulation.engine.native import NativeEngine as NativeEngine
from jaxsat.simulation.engine.single import fly as fly
