"""Roots and angles whose derivative is zero where the usual ones have none: at zero.

There a root, a length and the angle of a vector have a corner or a jump. JAX's rules divide by
zero, and what they make is NaN even where the result counts for nothing. Values are the usual ones.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


@jax.custom_jvp
def root(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """√x of what is not negative."""
    return jnp.sqrt(x)


@root.defjvp
def _root_jvp(primals, tangents):
    found = root(primals[0])
    positive = found > 0
    return found, jnp.where(positive, tangents[0] * (0.5 / jnp.where(positive, found, 1.0)), 0.0)


def length(vector: Float[Array, " n"]) -> Float[Array, ""]:
    """|v|."""
    return root(jnp.sum(vector**2))


@jax.custom_jvp
def angle_of(y: Float[Array, "*n"], x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The angle of (x, y) from the first axis, rad in [-π, π]."""
    return jnp.arctan2(y, x)


@angle_of.defjvp
def _angle_jvp(primals, tangents):
    (y, x), (dy, dx) = primals, tangents
    square = x**2 + y**2
    turned = (x * dy - y * dx) / jnp.where(square > 0, square, 1.0)
    return angle_of(y, x), jnp.where(square > 0, turned, 0.0)
