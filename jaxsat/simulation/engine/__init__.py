"""Engines: how the cases of a closed loop are run together, and what comes out of each."""

from jaxsat.simulation.engine.fixed import FixedStepper as FixedStepper
from jaxsat.simulation.engine.native import NativeEngine as NativeEngine
from jaxsat.simulation.engine.single import fly as fly
