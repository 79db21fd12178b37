"""The compiled engine: programs for one trajectory as vector code, a lane for each.

`Mapped` does the same for any function of `jax.numpy`.
"""

from jaxsat.engine.native.engine import NativeEngine, native_obstacle, process_obstacle
from jaxsat.engine.native.lowering import CannotLower
from jaxsat.engine.native.mapped import Mapped

__all__ = ["CannotLower", "Mapped", "NativeEngine", "native_obstacle", "process_obstacle"]
