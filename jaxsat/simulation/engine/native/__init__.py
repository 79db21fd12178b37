"""The compiled engine: programs for one trajectory as vector code, one lane per trajectory."""

from jaxsat.simulation.engine.native.engine import NativeEngine, native_obstacle, process_obstacle

__all__ = ["NativeEngine", "native_obstacle", "process_obstacle"]
