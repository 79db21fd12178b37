"""A traced function becomes a scalar program, and that machine code or C.

It knows no spacecraft. `Mapped` is any function of `jax.numpy` as vector code.
"""

from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.compiler.lowering import CannotLower

__all__ = ["CannotLower", "Mapped"]
