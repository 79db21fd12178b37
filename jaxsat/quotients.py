"""A reciprocal whose derivative takes no further division."""

import jax
from jaxtyping import Array, Float


@jax.custom_jvp
def reciprocal(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """1/x.

    Its derivative -1/x² is made from 1/x itself. Divisions are what a step of a law spends most of
    its time with, and JAX's own rule for a quotient adds one for every derivative.
    """
    return 1 / x


@reciprocal.defjvp
def _reciprocal_jvp(primals, tangents):
    found = reciprocal(primals[0])
    return found, -found * found * tangents[0]
