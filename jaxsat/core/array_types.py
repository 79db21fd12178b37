"""Names of array types that many modules use."""

from jaxtyping import Array, Float

RealScalar = Float[Array, ""]
