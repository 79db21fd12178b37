"""Compiler of traced functions: to a scalar program, and from that to machine code or C.

It is independent of spacecraft. `Mapped` is any function of `jax.numpy` as vector code.
"""

from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.compiler.lowering import CannotLower

__all__ = ["CannotLower", "Mapped"]
