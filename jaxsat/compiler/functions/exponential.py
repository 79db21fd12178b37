"""exp and its relatives, and logarithms.

x = n log(2) + r, |r| <= log(2)/2, with log(2) in two pieces, the first of 42 bits, so that its
product with n is exact; exp(r) is a polynomial (benchmarks/native/minimax.py).

Logarithms: x = 2^k (1 + f), 1 + f from sqrt(1/2) to sqrt(2), s = f/(2 + f): log(1 + f) = 2 s +
s L(s^2), summed as f - (f^2/2 - s (f^2/2 + L)), the form of fdlibm's e_log.c (Sun Microsystems,
1993).
"""

import math

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    fast_two_sum,
    fitted,
    mantissa_and_exponent,
    polynomial,
    power_of_two,
    quotient,
    rounded,
    scaled,
    select,
    to_double,
)

LOG2_UPPER, LOG2_LOWER = 0.6931471805598903, 5.497923018708371e-14
LOG2_E = math.log2(math.e)
_LOG2 = math.log(2.0)

_EXPONENTIAL = fitted("EXPONENTIAL")
_LOGARITHM = fitted("LOGARITHM")


def exp(x: Double) -> Double:
    """Exponential."""
    return scaled(*exp_parts(bounded(x, -746.0, 710.0)))


def exp2(x: Double) -> Double:
    """Two to the power x."""
    x = bounded(x, -1076.0, 1025.0)
    whole, n = rounded(x)
    r = (x - whole) * _LOG2
    return scaled(1.0 + (r + r * r * polynomial(r, _EXPONENTIAL)), n)


def expm1(x: Double) -> Double:
    """exp(x) - 1, as accurate near zero."""
    x = bounded(x, -40.0, 710.0)
    r, low, n = _reduced(x)
    small = lax.min(n, lax.full_like(n, 60))
    total, error = fast_two_sum(1.0 - power_of_two(-small), r)
    # n = 0: the first is zero and the sum exact.
    rest = low + r * r * polynomial(r, _EXPONENTIAL)
    return select(x == 0.0, x, scaled(total + (rest + error), n))


def logistic(x: Double) -> Double:
    """1/(1 + exp(-x))."""
    near_one, low, n = exp_pair(bounded(-lax.abs(x), -746.0, 710.0))
    e, e_low = scaled(near_one, n), scaled(low, n)
    den, den_low = fast_two_sum(lax.full_like(x, 1.0), e)
    below = x < 0.0
    return quotient(select(below, e, 1.0), select(below, e_low, 0.0), den, den_low + e_low)


def exp_parts(x: Double, low: Double | None = None) -> tuple[Double, Integer]:
    """Return exp(x + low) as a number near one and a power of two; `low` is x's rounding error."""
    r, rest, n = _reduced(x, low)
    return 1.0 + (r + (r * r * polynomial(r, _EXPONENTIAL) + rest)), n


def exp_pair(x: Double, low: Double | None = None) -> tuple[Double, Double, Integer]:
    """Return exp(x + low) as a number near one, its rounding error and a power of two."""
    r, rest, n = _reduced(x, low)
    tail = r + (r * r * polynomial(r, _EXPONENTIAL) + rest)
    return *fast_two_sum(lax.full_like(x, 1.0), tail), n


def expm1_pair(x: Double) -> tuple[Double, Double]:
    """Return exp(x) - 1 and its rounding error, for x in [0, 40]."""
    r, low, n = _reduced(x)
    power = power_of_two(n)
    total, error = fast_two_sum(power - 1.0, power * r)
    return fast_two_sum(total, error + power * (r * r * polynomial(r, _EXPONENTIAL) + low))


def bounded(x: Double, least: float, most: float) -> Double:
    """Return `x` within bounds; NaN stays."""
    return select(x < least, least, select(x > most, most, x))


def _reduced(x: Double, low: Double | None = None) -> tuple[Double, Double, Integer]:
    """Return r, its rounding error and n of x + low = n log(2) + r."""
    whole, n = rounded(x * LOG2_E)
    upper = x - whole * LOG2_UPPER
    lower = whole * -LOG2_LOWER if low is None else low - whole * LOG2_LOWER
    r = upper + lower
    return r, (upper - r) + lower, n


SQRT_HALF = 0.7071067811865476
MIN_NORMAL = 2.0**-1022


def log(x: Double) -> Double:
    """Natural logarithm: -inf of zero, NaN of negative numbers."""
    mantissa, k = split(x)
    value = _sum(mantissa - 1.0, None, to_double(k))
    return _at_the_ends(x, value)


def near_log(x: Double) -> Double:
    """Return the natural logarithm of a positive normal number."""
    mantissa, k = mantissa_and_exponent(x, SQRT_HALF)
    return _sum(mantissa - 1.0, None, to_double(k))


def log1p(x: Double) -> Double:
    """log(1 + x), as accurate near zero."""
    total = 1.0 + x
    larger, smaller = select(x > 1.0, x, 1.0), select(x > 1.0, 1.0, x)
    lost = smaller - (total - larger)
    mantissa, k = mantissa_and_exponent(select(total > 0.0, total, 1.0), SQRT_HALF)
    # The bits lost, in the mantissa's scale.
    lost = lost * power_of_two(-lax.min(k, lax.full_like(k, 1000)))
    value = _sum(mantissa - 1.0, lost, to_double(k))
    return select(x == 0.0, x, _at_the_ends(total, value))


def log_of_pair(x: Double, low: Double, doublings: Integer) -> Double:
    """Return log((x + low) 2^doublings) of an x from one on and a much smaller `low`."""
    mantissa, k = mantissa_and_exponent(x, SQRT_HALF)
    low = low * power_of_two(-lax.min(k, lax.full_like(k, 1000)))
    return _sum(mantissa - 1.0, low, to_double(k + doublings))


def split(x: Double) -> tuple[Double, Integer]:
    """Return the mantissa from sqrt(1/2) to sqrt(2) and the exponent of any positive x."""
    tiny = x < MIN_NORMAL
    mantissa, k = mantissa_and_exponent(select(tiny, x * 2.0**54, x), SQRT_HALF)
    return mantissa, k - lax.select(tiny, lax.full_like(k, 54), lax.full_like(k, 0))


def _sum(f: Double, lost: Double | None, k: Double) -> Double:
    """Return log(1 + f + lost) + k log(2); `lost` is None for zero."""
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    # 1/(1 + f) is 1 - 2 s + 2 s^2 - ... ; `lost` needs few digits.
    correction = k * LOG2_LOWER
    if lost is not None:
        correction = correction + lost * (1.0 - 2.0 * s * (1.0 - s * (1.0 - s)))
    tail = s * (half + z * polynomial(z, _LOGARITHM)) + correction
    return k * LOG2_UPPER - ((half - tail) - f)


def _at_the_ends(x: Double, value: Double) -> Double:
    """Replace the logarithm of zero, negative numbers, infinity and NaN by its special value."""
    below = select(x == 0.0, -np.inf, np.nan)
    return select((x > 0.0) & (x < np.inf), value, select(x == np.inf, np.inf, below))
