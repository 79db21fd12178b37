"""Substitutes for sat and sqrt|x|: the printed functions without a width, smooth ones with one.

A printed function has a corner. Held on one side of the corner it is smooth, so an integrator can
hold the side during a step and search for the instant at which it changes. Otherwise it follows
its argument, and derivatives are those of the piece that contains the argument.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.core.checks import as_float, concrete
from jaxsat.core.quotients import reciprocal

Width = RealScalar | None
"""Width over which a corner is rounded; None for the printed corner."""

AT_CORNER = 1e-20
"""Threshold on the argument of the printed √|x|, below which it is zero."""


def as_width(value: ArrayLike | None) -> Width:
    """Return a width as an array, and None for a concrete zero."""
    if value is None:
        return None
    number = concrete(value)
    return None if number is not None and not np.any(number) else as_float(value)


def sat(
    x: Float[Array, "*n"],
    bound: RealScalar,
    width: Width = None,
    beyond: Bool[Array, "*n"] | None = None,
) -> Float[Array, "*n"]:
    """Saturation of (41): x up to `bound`, then sign(x) `bound`.

    `width` in [0, 1] is the part of `bound` over which the corner is rounded, 1 being
    bound·tanh(x / bound); it differs from the printed function by at most 0.24 width·bound.
    The printed function stays on the side of its corner that `beyond` gives.
    """
    if width is None:
        outside = jnp.abs(x) > bound if beyond is None else beyond
        return jnp.where(outside, jnp.where(x < 0, -bound, bound), x)
    span = width * bound
    straight = bound - span
    inside = jnp.where(jnp.abs(x) <= straight, x, jnp.where(x < 0, -straight, straight))
    excess = x - inside
    return inside + span * jnp.tanh(excess * reciprocal(jnp.where(span > 0, span, 1.0)))


def root_abs(x: RealScalar, width: Width = None, positive: BoolScalar | None = None) -> RealScalar:
    """Return √|x| of (38), or (x² + width²)^¼ with a `width` in the unit of x.

    With `positive` the printed function is √x, or √(-x) where it is false, and zero beyond the
    corner; its derivative is zero at the corner and beyond. The corner is as wide as `AT_CORNER`:
    an integrator that ends its step there is off by round-off, and would continue with an
    arbitrarily large slope.
    """
    if width is None:
        size = jnp.abs(x) if positive is None else jnp.where(positive, x, -x)
        away = size > AT_CORNER
        return jnp.where(away, jnp.sqrt(jnp.where(away, size, 1.0)), 0.0)
    square = x**2 + width**2
    return jnp.where(square > 0, jnp.where(square > 0, square, 1.0) ** 0.25, 0.0)


def signed_root(
    x: RealScalar, width: Width = None, positive: BoolScalar | None = None
) -> RealScalar:
    """Return sgn(x) √|x| of (38), or x / (x² + width²)^¼ with a `width`; see `root_abs`."""
    if width is None:
        sign = jnp.sign(x) if positive is None else jnp.where(positive, 1.0, -1.0)
        return sign * root_abs(x, None, positive)
    square = x**2 + width**2
    return jnp.where(square > 0, x / jnp.where(square > 0, square, 1.0) ** 0.25, 0.0)


@jax.custom_jvp
def without_slope(x: Float[Array, "*n"], where: Bool[Array, "*n"]) -> Float[Array, "*n"]:
    """Return x, with a derivative of zero `where` it is negligible.

    For a number next to zero whose slope grows as the number shrinks.
    """
    return x


@without_slope.defjvp
def _without_slope_jvp(primals, tangents):
    x, where = primals
    return without_slope(x, where), jnp.where(where, 0.0, tangents[0])


@jax.custom_jvp
def positive_part(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return max(x, 0) with the right-hand slope at zero; JAX's own takes half of it."""
    return jnp.maximum(x, 0.0)


@positive_part.defjvp
def _positive_part_jvp(primals, tangents):
    return positive_part(primals[0]), jnp.where(primals[0] < 0, 0.0, tangents[0])


@jax.custom_jvp
def at_least(x: Float[Array, "*n"], least: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Return max(x, least), with the slope of x where both are equal."""
    return jnp.maximum(x, least)


@at_least.defjvp
def _at_least_jvp(primals, tangents):
    return at_least(*primals), jnp.where(primals[0] < primals[1], tangents[1], tangents[0])


def within(
    x: Float[Array, "*n"], least: Float[Array, "*n"], most: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Return x clipped to two bounds, with the slope of x at a bound."""
    return -at_least(-at_least(x, least), -most)
