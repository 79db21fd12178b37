"""Sine and cosine in basic operations, which XLA compiles to vector code.

XLA on CPUs calls the C library for every sine of a double; that was a third of the time of a batch.
Cody and Waite's reduction in three pieces, then one polynomial. That of the sine is valid for a
half-turn, from -pi/2 to pi/2, without a case distinction. Those of the cosine, which must be
exactly 1 at 0, are valid for a quarter each, and the quadrant selects the coefficients (those of
fdlibm, Sun Microsystems, 1993). Up to 2^14 errors are below two units in the last place; beyond,
they are those of one unit in the last place of the *argument*, and the results stay bounded by
about one.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jaxsat.core.jax_internals import Primitive, ad, batching, mlir

SINE = (
    -0.16666666666666666,
    0.008333333333330946,
    -0.0001984126983675497,
    2.755731610068303e-06,
    -2.5051131455427946e-08,
    1.591810123027412e-10,
)
COSINE = (
    0.041666666666666664,
    -0.0013888888888887395,
    2.4801587298763433e-05,
    -2.7557317270560326e-07,
    2.0876146024689747e-09,
    -1.1382614868556325e-11,
)
HALF_TURN = (
    -0.16666666666666666,
    0.008333333333333316,
    -0.00019841269841254795,
    2.7557319219115013e-06,
    -2.505210761086116e-08,
    1.6058976915095007e-10,
    -7.643957622560617e-13,
    2.7312868913092307e-15,
)
_PIECES = (1.5707963267923333, 2.5633441515905732e-12, 3.9455541665632055e-24)  # 39 bits each
_HALF_TURN_PIECES = tuple(2 * piece for piece in _PIECES)
_TWO_OVER_PI = 2 / np.pi
_ONE_OVER_PI = 1 / np.pi
ROUNDER = 1.5 * 2.0**52
"""Constant that, added to a far smaller number, leaves the nearest integer in the lowest bits."""

NEAR_LIMIT = 2.0**14
"""Largest angle (rad) with an accurate reduction."""

SIGN = np.int64(-(2**63))


def sin(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Sine of an angle, rad."""
    return jnp.asarray(_sin_p.bind(jnp.asarray(x)))


def cos(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Cosine of an angle, rad."""
    return jnp.asarray(_cos_p.bind(jnp.asarray(x)))


def reduced(size: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Int[Array, "*n"]]:
    """Return r and q of x = q pi/2 + r for positive x; only two bits of q matter.

    Below `NEAR_LIMIT` the products are exact and so is the first difference; the second is rounded
    unless r is so small that the third matters. There r is correct to one unit in the last place.
    """
    return _less_multiple(size, _TWO_OVER_PI, _PIECES)


def _less_multiple(size, times: float, pieces) -> tuple[Array, Int[Array, "*n"]]:
    shifted = ROUNDER + size * times
    less = ROUNDER - shifted  # minus the multiple
    first, second, third = pieces
    return ((size + less * first) + less * second) + less * third, bits_of(shifted)


def _of_reduced(r: Float[Array, "*n"], by_cosine: Bool[Array, "*n"]) -> Float[Array, "*n"]:
    """Return cosine or sine of a reduced angle by one polynomial with selected coefficients."""
    z = r * r
    total = _either(by_cosine, COSINE[-1], SINE[-1])
    for c, s in zip(COSINE[-2::-1], SINE[-2::-1], strict=True):
        total = _either(by_cosine, c, s) + total * z
    first = _either(by_cosine, 1.0 - 0.5 * z, r)
    return first + z * _either(by_cosine, z, r) * total


def _either(condition: Bool[Array, "*n"], x: ArrayLike, y: ArrayLike) -> Float[Array, "*n"]:
    """Return `jnp.where` without a nested call."""
    full = (jnp.broadcast_to(jnp.asarray(v, jnp.float64), condition.shape) for v in (x, y))
    return lax.select(condition, *full)


def is_odd(quadrant: Int[Array, "*n"]) -> Bool[Array, "*n"]:
    """Whether sine and cosine change places in this quadrant."""
    return (quadrant & np.int64(1)) != 0


def bits_of(x: Float[Array, "*n"]) -> Int[Array, "*n"]:
    """Return the bits of a double as an integer."""
    return lax.bitcast_convert_type(x, jnp.int64)


def signed(x: Float[Array, "*n"], bits: Int[Array, "*n"]) -> Float[Array, "*n"]:
    """Return `x` with its sign flipped where the sign bit of `bits` is set."""
    return lax.bitcast_convert_type(bits_of(x) ^ (bits & SIGN), jnp.float64)


def _sin(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    r, k = _less_multiple(jnp.abs(x), _ONE_OVER_PI, _HALF_TURN_PIECES)
    r = lax.clamp(-2.0, r, 2.0)  # bounded where x is too large to be reduced
    z = r * r
    total = jnp.full_like(r, HALF_TURN[-1])
    for coefficient in HALF_TURN[-2::-1]:
        total = coefficient + total * z
    return signed(r + z * r * total, (k << 63) ^ bits_of(x))


def _cos(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    r, quadrant = reduced(jnp.abs(x))
    following = quadrant + np.int64(1)
    return signed(_of_reduced(lax.clamp(-1.0, r, 1.0), is_odd(following)), following << 62)


def _primitive(name: str, usual: Callable, written: Callable) -> Primitive:
    """Return a primitive that is `written` for doubles on a CPU and `usual` everywhere else."""
    primitive = Primitive(name)

    def on_processor(x):
        return written(x) if x.dtype == jnp.float64 else usual(x)

    primitive.def_abstract_eval(lambda x: x)
    primitive.def_impl(jax.jit(lambda x: primitive.bind(x)))
    batching.defvectorized(primitive)
    mlir.register_lowering(primitive, mlir.lower_fun(usual, multiple_results=False))
    lowering = mlir.lower_fun(on_processor, multiple_results=False)
    mlir.register_lowering(primitive, lowering, platform="cpu")
    return primitive


_sin_p = _primitive("jaxsat_sin", jnp.sin, _sin)
_cos_p = _primitive("jaxsat_cos", jnp.cos, _cos)
ad.defjvp(_sin_p, lambda tangent, x: tangent * cos(x))
ad.defjvp(_cos_p, lambda tangent, x: -tangent * sin(x))
