"""pow and cbrt.

pow needs y log(x) to 64 bits: logarithm and product are carried as sums of two doubles, the larger
cut so that products are exact (after fdlibm's e_pow.c, Sun Microsystems, 1993, without its table).
"""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    bits_of,
    double_of,
    fast_two_sum,
    fitted,
    mantissa_and_exponent,
    negative,
    polynomial,
    power_of_two,
    rounded,
    scaled,
    select,
    to_double,
    upper,
    upper_17,
    with_sign_of,
)
from jaxsat.compiler.functions.exponential import (
    LOG2_LOWER,
    LOG2_UPPER,
    MIN_NORMAL,
    bounded,
    exp_parts,
    split,
)

_TWO_THIRDS, _TWO_THIRDS_LOW = 0.6666666666666666, 3.700743415417188e-17
_LOGARITHM_REST = fitted("LOGARITHM_REST")
_RECIPROCAL_CUBE_ROOT = fitted("RECIPROCAL_CUBE_ROOT")


def pow(x: Double, y: Double) -> Double:
    """x to the power y, with the special values of C99 and NumPy."""
    size = lax.abs(x)
    usual = (size > 0.0) & (size < np.inf)
    log_upper, log_lower = _logarithm(select(usual, size, 1.0))
    # Beyond 2^66 every power of every double but one is 0 or infinite.
    exponent = bounded(y, -(2.0**66), 2.0**66)
    cut = upper(exponent)
    rest = (exponent - cut) * log_upper + exponent * log_lower
    product, rest = fast_two_sum(cut * log_upper, rest)
    value = scaled(*exp_parts(*_in_range(product, rest)))
    unusual = select((size == 0.0) ^ (y < 0.0), 0.0, np.inf)
    value = select(usual, value, select(x != x, np.nan, unusual))
    return _signs_and_ones(x, y, value)


def _logarithm(x: Double) -> tuple[Double, Double]:
    """Return log(x) of a positive finite x as 26 bits and a remainder, together over 64 bits."""
    mantissa, k = split(x)
    num, den = mantissa - 1.0, mantissa + 1.0
    inverse = 1.0 / den
    cut = upper(num * inverse)
    den_upper = upper(den)
    den_lower = mantissa - (den_upper - 1.0)
    low = ((num - cut * den_upper) - cut * den_lower) * inverse
    s = cut + low
    # s^2, then c = 2/3 + 2/5 s^2 + ..., then t = s^3 c
    square, square_low = cut * cut, low * (cut + s)
    z = square + square_low
    beyond = z * polynomial(z, _LOGARITHM_REST)
    c_upper = upper(_TWO_THIRDS + beyond)
    c_lower = ((_TWO_THIRDS - c_upper) + beyond) + _TWO_THIRDS_LOW
    z_upper = upper(z)
    z_lower = (square - z_upper) + square_low
    leading = z_upper * c_upper
    trailing = z_upper * c_lower + z_lower * (c_upper + c_lower)
    factor = upper(leading + trailing)
    factor_low = (leading - factor) + trailing
    cube = cut * factor
    rest = low * (factor + factor_low) + cut * factor_low
    # The sum, the largest first.
    power = to_double(k)
    total, error = fast_two_sum(power * LOG2_UPPER, 2.0 * cut)
    total, second = fast_two_sum(total, cube)
    error = error + second + (2.0 * low + rest + power * LOG2_LOWER)
    whole = total + error
    log_upper = upper(whole)
    return log_upper, (total - log_upper) + error


def _in_range(product: Double, rest: Double) -> tuple[Double, Double]:
    """Return an exponent in two parts, clipped where exp is 0 or infinite."""
    inside = lax.abs(product) < 800.0
    ends = bounded(product, -800.0, 800.0)
    return select(inside, product, ends), select(inside, rest, 0.0)


def _signs_and_ones(x: Double, y: Double, value: Double) -> Double:
    """Return `value`, the power of |x|, with the sign of x^y, NaN where it has none, and ones."""
    whole = lax.floor(y) == y
    half = 0.5 * y
    odd = whole & (lax.floor(half) != half)
    turned = double_of(bits_of(value) | (np.int64(1) << 63))
    value = select(negative(x) & odd, turned, value)
    value = select((x < 0.0) & (x > -np.inf) & ~whole, np.nan, value)
    value = select(y != y, np.nan, value)
    infinite = lax.abs(y) == np.inf
    return select((x == 1.0) | (y == 0.0) | ((x == -1.0) & infinite), 1.0, value)


def cbrt(x: Double) -> Double:
    """Cube root, by its inverse: no division."""
    size = lax.abs(x)
    usual = (size > 0.0) & (size < np.inf)
    size = select(usual, size, 1.0)
    tiny = size < MIN_NORMAL
    mantissa, k = mantissa_and_exponent(select(tiny, size * 2.0**54, size), 1.0)
    third, m, y = _in_thirds(mantissa, k)
    # y is m^(-1/3) to 17 bits; the step squares its error twice.
    error = 1.0 - m * y * y * y
    y = y + y * error * (1 / 3 + error * (2 / 9))
    root = upper_17(m * y * y)
    error = (m - root * root * root) * (y * y * y)
    step = error * (1 / 3 + error * (2 / 9 + error * (14 / 81 + error * (35 / 243))))
    root = (root + root * step) * power_of_two(third)
    root = select(tiny, root * 2.0**-18, root)
    return select(usual, with_sign_of(root, x), x)


def _in_thirds(mantissa: Double, k: Integer) -> tuple[Integer, Double, Double]:
    """Return n, m from 1 to 8 and an estimate of m^(-1/3) of mantissa 2^k = m 2^(3 n)."""
    whole, third = rounded((to_double(k) - 1.0) * (1 / 3))
    remainder = to_double(k) - 3.0 * whole
    estimate = polynomial(mantissa, _RECIPROCAL_CUBE_ROOT)
    one, two = remainder == 1.0, remainder == 2.0
    factor = select(one, 2 ** (-1 / 3), select(two, 2 ** (-2 / 3), 1.0))
    return third, mantissa * select(one, 2.0, select(two, 4.0, 1.0)), estimate * factor
