"""Parts of a double: its bits, powers of two, halves whose products are exact.

A compiler may fuse a*b + c into one rounding. Results of this package do not depend on it: wherever
a rounding error is used further, the product before it is of factors cut to 26 bits (by masking,
which no compiler undoes) or of a constant with trailing zeros, hence exact, and fusing an exact
product changes nothing. Two-sums have no products.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, ArrayLike, Bool, Float64, Int64

from jaxsat.core.package_files import data_of
from jaxsat.core.trigonometry import ROUNDER, SIGN, bits_of

Double = Float64[Array, "*n"]
Integer = Int64[Array, "*n"]
Truth = Bool[Array, "*n"]

_UPPER_26 = np.int64(-(2**27))
_UPPER_17 = np.int64(-(2**36))
_ROUNDER_BITS = np.float64(ROUNDER).view(np.int64)
_COEFFICIENTS = data_of("jaxsat.compiler.functions", "coefficients.toml")


def double_of(bits: Integer) -> Double:
    """Return the double with these bits."""
    return lax.bitcast_convert_type(bits, jnp.float64)


def select(condition: Truth, x: ArrayLike, y: ArrayLike) -> Double:
    """Return `x` where the condition holds, else `y`; numbers become doubles of its shape."""
    shape = jnp.shape(condition)
    x, y = (v if jnp.shape(v) == shape else lax.full(shape, v, jnp.float64) for v in (x, y))
    return lax.select(condition, x, y)


def shift_right(bits: Integer, count: int) -> Integer:
    """Shift to the right, filling with zeros."""
    return lax.shift_right_logical(bits, lax.full_like(bits, count))


def negative(x: Double) -> Truth:
    """Whether the sign bit is set, also that of -0.0."""
    return bits_of(x) < 0


def with_sign_of(x: Double, y: Double) -> Double:
    """Return `x`, whose sign bit is clear, with the sign bit of `y`."""
    return double_of(bits_of(x) | (bits_of(y) & SIGN))


def power_of_two(n: Integer) -> Double:
    """Return 2^n of an integer from -1022 to 1023."""
    return double_of((n + np.int64(1023)) << 52)


def scaled(x: Double, n: Integer) -> Double:
    """Return x 2^n, rounded once, for a normal x near one and any n from -2040 to 2040."""
    half = n >> 1
    return x * power_of_two(half) * power_of_two(n - half)


def rounded(x: Double) -> tuple[Double, Integer]:
    """Return the nearest integer (ties to even), |x| < 2^51, as a double and as an integer."""
    whole = lax.round(x, lax.RoundingMethod.TO_NEAREST_EVEN)
    return whole, bits_of(whole + ROUNDER) - _ROUNDER_BITS


def to_double(n: Integer) -> Double:
    """Return an integer below 2^51 in size as a double (no instruction for it below AVX-512)."""
    return double_of(n + _ROUNDER_BITS) - ROUNDER


def upper(x: Double) -> Double:
    """Return the upper 26 bits of a double: the product of two such numbers is exact."""
    return double_of(bits_of(x) & _UPPER_26)


def upper_17(x: Double) -> Double:
    """Return the upper 17 bits of a double: its cube is exact."""
    return double_of(bits_of(x) & _UPPER_17)


def mantissa_and_exponent(x: Double, lowest: float) -> tuple[Double, Integer]:
    """Return m and k of x = m 2^k with m from `lowest` to twice that; x is positive and normal."""
    bits = bits_of(x)
    k = (bits - np.float64(lowest).view(np.int64)) >> 52
    return double_of(bits - (k << 52)), k


def fast_two_sum(x: Double, y: Double) -> tuple[Double, Double]:
    """Return x + y, rounded, and its rounding error; |x| >= |y| or the sum is exact.

    x may be a constant: XLA would simplify (x + y) - x then, but not x - (x + y).
    """
    total = x + y
    return total, (x - total) + y


def quotient(num: Double, num_low: ArrayLike, den: Double, den_low: ArrayLike) -> Double:
    """Return (num + num_low)/(den + den_low) with hardly more than the last rounding's error.

    The first estimate is cut to 26 bits, so that the remainder of the division is exact. Where that
    would be subnormal the plain quotient is used, without the low parts.
    """
    inverse = 1.0 / den
    plain = num * inverse
    estimate = upper(plain)
    den_upper = upper(den)
    remainder = (num - estimate * den_upper) - estimate * ((den - den_upper) + den_low)
    fine = estimate + (remainder + num_low) * inverse
    return select(lax.abs(num) > 2.0**-900, fine, plain)


def fitted(name: str) -> tuple[float, ...]:
    """Return the coefficients of a polynomial of `coefficients.toml`, lowest power first."""
    return tuple(_COEFFICIENTS[name])


def polynomial(x: Double, coefficients: Sequence[float]) -> Double:
    """Evaluate a polynomial, lowest power first, by Estrin's scheme: a short critical path."""
    terms: list[Double | float] = list(coefficients)
    while len(terms) > 1:
        pairs = [low + high * x for low, high in zip(terms[::2], terms[1::2], strict=False)]
        terms = [*pairs, *terms[len(pairs) * 2 :]]
        x = x * x
    return jnp.asarray(terms[0])


def horner(x: Double, coefficients: Sequence[float | Double]) -> Double:
    """Evaluate a polynomial, lowest power first, by Horner's scheme: few operations."""
    total = jnp.asarray(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = coefficient + total * x
    return total
