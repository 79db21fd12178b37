"""The rules by which primitives are lowered, by what kind of primitive they are for."""

from jaxsat.engine.native.rules import (
    calls,
    control,
    elementwise,
    indexing,
    mathematics,
    reductions,
    structural,
)

__all__ = [
    "calls",
    "control",
    "elementwise",
    "indexing",
    "mathematics",
    "reductions",
    "structural",
]
