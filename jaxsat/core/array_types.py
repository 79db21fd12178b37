"""Aliases of array types shared by many modules."""

from jaxtyping import Array, Bool, Float, Int

RealScalar = Float[Array, ""]
IntScalar = Int[Array, ""]
BoolScalar = Bool[Array, ""]

Pair = Float[Array, "2"]
"""Two components, about the first two body axes unless stated."""

Vector = Float[Array, "3"]
"""Three components, in body axes unless stated."""

Matrix = Float[Array, "3 3"]
"""A matrix whose rows and columns are those of the same axes."""
