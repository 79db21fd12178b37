"""Quotients, roots and angles with better derivatives than JAX's own.

Derivatives of a reciprocal and of a quotient take no further division, and those of `share_within`
no infinite number. A root, a length and the angle of a vector have a corner or a jump at zero,
where JAX's rules divide by zero and return NaN even for unused results: the derivative there is
zero. Values are the usual ones.
"""

import functools

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite."""


@jax.custom_jvp
def reciprocal(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return 1/x.

    The derivative -1/x² is computed from 1/x itself. Divisions dominate the time of a step of a
    law, and JAX's own rule for a quotient adds one for every derivative.
    """
    return 1 / x


@reciprocal.defjvp
def _reciprocal_jvp(primals, tangents):
    value = reciprocal(primals[0])
    return value, -value * value * tangents[0]


@jax.custom_jvp
def quotient(x: Float[Array, "*n"], y: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return x/y, by way of 1/y."""
    return x * reciprocal(y)


@functools.partial(quotient.defjvp, symbolic_zeros=True)
def _quotient_jvp(primals, tangents):
    (x, y), (dx, dy) = primals, tangents
    inverse = reciprocal(y)
    value = x * inverse
    if isinstance(dy, SymbolicZero):
        change = jnp.zeros_like(value) if isinstance(dx, SymbolicZero) else dx
    else:
        change = -value * dy if isinstance(dx, SymbolicZero) else dx - value * dy
    return value, inverse * change


def share_within(most: RealScalar, size: RealScalar) -> RealScalar:
    """Return min(1, most / size): the part of a size within a bound, which may be infinite.

    Infinity over a size has NaN as its derivative, so the division is skipped there.
    """
    exceeds = size > most
    return jnp.where(exceeds, most, 1.0) / jnp.where(exceeds, size, 1.0)


@jax.custom_jvp
def root(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return √x for x that is not negative, with a derivative of zero at zero."""
    return jnp.sqrt(x)


@root.defjvp
def _root_jvp(primals, tangents):
    value = root(primals[0])
    positive = value > 0
    return value, jnp.where(positive, tangents[0] * (0.5 / jnp.where(positive, value, 1.0)), 0.0)


def cube_root(x: RealScalar) -> RealScalar:
    """Return ∛x, zero with a derivative of zero for x that is not positive."""
    return jnp.where(x > 0, jnp.cbrt(jnp.where(x > 0, x, 1.0)), 0.0)


def length(vector: Float[Array, " n"]) -> RealScalar:
    """Return the Euclidean norm |v|, with a derivative of zero at zero."""
    return root(jnp.sum(vector**2))


@jax.custom_jvp
def angle_of(y: Float[Array, "*n"], x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return the angle of (x, y) from the first axis, rad in [-π, π]."""
    return jnp.arctan2(y, x)


@angle_of.defjvp
def _angle_jvp(primals, tangents):
    (y, x), (dy, dx) = primals, tangents
    square = x**2 + y**2
    slope = (x * dy - y * dx) / jnp.where(square > 0, square, 1.0)
    return angle_of(y, x), jnp.where(square > 0, slope, 0.0)
