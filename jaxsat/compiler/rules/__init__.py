"""The rules by which primitives are lowered, by what kind of primitive they are for."""

from jaxsat.compiler.rules import (
    calls,
    control,
    elementwise,
    indexing,
    linear_algebra,
    mathematics,
    random,
    reductions,
    structural,
    windows,
)

__all__ = [
    "calls",
    "control",
    "elementwise",
    "indexing",
    "linear_algebra",
    "mathematics",
    "random",
    "reductions",
    "structural",
    "windows",
]
