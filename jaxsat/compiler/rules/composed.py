"""Rules of primitives that are composed of others, each written in `jax.numpy`."""

import functools
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Shaped

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.lowering import Elements, lowers, written


def _top_k(x: Array, k: int, axis: int) -> list[Array]:
    """Return the largest first, equal ones in their order; floats in IEEE 754's total order, as
    XLA's: -0.0 below 0.0, NaN beyond all on the side of its sign."""
    numbers = lax.broadcasted_iota(jnp.int32, x.shape, axis)
    last = [lax.rev(y, (axis,)) for y in (_in_total_order(x), x, numbers)]
    ordered = lax.sort(last, dimension=axis, num_keys=1)[1:]
    return [lax.slice_in_dim(lax.rev(y, (axis,)), 0, k, axis=axis) for y in ordered]


def _in_total_order(x: Array) -> Array:
    """Return integers in the order of these: the bits of a float, flipped for a negative one."""
    if x.dtype.kind != "f":
        return x
    word = np.dtype(f"i{x.dtype.itemsize}")
    bits = lax.bitcast_convert_type(x, word)
    return jnp.where(bits < 0, bits ^ np.iinfo(word).max, bits)


def _nextafter(x: Array, y: Array) -> Array:
    whole = jnp.int64 if x.dtype == jnp.float64 else jnp.int32
    bits = lax.bitcast_convert_type(x, whole)
    outwards = jnp.where((y > x) == (x > 0), bits + 1, bits - 1)
    least = lax.bitcast_convert_type(jnp.ones_like(bits), x.dtype)
    neighbour = jnp.where(
        x == 0, jnp.copysign(least, y), lax.bitcast_convert_type(outwards, x.dtype)
    )
    return jnp.where(x == y, y, jnp.where((x != x) | (y != y), np.nan, neighbour))


def _clz(x: Array) -> Array:
    """Count leading zeros: all bits below the first one are set and counted."""
    width = 8 * x.dtype.itemsize
    shift = 1
    while shift < width:
        x = x | lax.shift_right_logical(x, jnp.full_like(x, shift))
        shift *= 2
    return jnp.full_like(x, width) - lax.population_count(x)


def _tile(x: Shaped[Array, "..."], reps: tuple[int, ...]) -> Array:
    for axis, times in enumerate(reps):
        x = lax.concatenate([x] * times, axis)
    return x


def _reduce_precision(x: Array, exponent_bits: int, mantissa_bits: int) -> Array:
    """Return the nearest float of fewer bits, ties to even; subnormal results become zero."""
    info = jnp.finfo(x.dtype)
    word = np.dtype(f"u{x.dtype.itemsize}")
    bits, surplus = lax.bitcast_convert_type(x, word), info.nmant - mantissa_bits
    if surplus > 0:
        odd = (bits >> word.type(surplus)) & word.type(1)
        bits = bits + odd + word.type(2 ** (surplus - 1) - 1)
        bits = bits & np.invert(word.type(2**surplus - 1))
    if exponent_bits < info.nexp:
        bias, reduced = 2 ** (info.nexp - 1) - 1, 2 ** (exponent_bits - 1) - 1
        top, bottom = (word.type((bias + end) << info.nmant) for end in (reduced, -reduced))
        infinite = word.type((2**info.nexp - 1) << info.nmant)
        sign, exponent = bits & word.type(1 << (info.bits - 1)), bits & infinite
        bits = jnp.where(exponent > top, sign | infinite, bits)
        bits = jnp.where(exponent <= bottom, sign, bits)
    return jnp.where(x != x, x, lax.bitcast_convert_type(bits, x.dtype))


def _polynomial(x: Array, *coefficients: Array) -> Array:
    return functools.reduce(lambda total, c: total * x + c, reversed(coefficients))


COMPOSED: dict[str, Callable[..., Callable]] = {
    "clz": lambda **_: _clz,
    "cumlogsumexp": lambda **axis: partial(lax.associative_scan, jnp.logaddexp, **axis),
    "log2": lambda **_: lambda x: lax.log(x) / np.log(2).astype(x.dtype),
    "nextafter": lambda **_: _nextafter,
    "one_minus_square": lambda **_: lambda x: (1 + x) * (1 - x),
    "polynomial": lambda **_: _polynomial,
    "reduce_precision": lambda **bits: partial(_reduce_precision, **bits),
    "rsqrt": lambda **_: lambda x: 1 / jnp.sqrt(x),
    "square": lambda **_: lambda x: x * x,
    "tile": lambda reps, **_: partial(_tile, reps=reps),
    "top_k": lambda k, axis=-1, **_: partial(_top_k, k=k, axis=axis),
}
"""Makers of a primitive's function from its parameters, by the primitive's name."""


@lowers(*COMPOSED)
def _composed(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    shapes = [
        jax.ShapeDtypeStruct(x.shape, v.aval.dtype) for x, v in zip(arrays, eqn.inputs, strict=True)
    ]
    function = COMPOSED[eqn.name](**eqn.parameters)
    return written(b, function, shapes, *arrays)
