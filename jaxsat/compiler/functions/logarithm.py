"""log and log1p, with the argument's exponent split off.

x = 2^k (1 + f), 1 + f from sqrt(1/2) to sqrt(2), s = f/(2 + f): log(1 + f) = 2 s + s L(s^2), summed
as f - (f^2/2 - s (f^2/2 + L)), the form of fdlibm's e_log.c (Sun Microsystems, 1993).
"""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    mantissa_and_exponent,
    polynomial,
    power_of_two,
    select,
    to_double,
)
from jaxsat.compiler.functions.exponential import LOG2_LOWER, LOG2_UPPER

SQRT_HALF = 0.7071067811865476
MIN_NORMAL = 2.0**-1022
_LOGARITHM = (
    0.666666666666667,
    0.3999999999989889,
    0.28571428626253836,
    0.22222211089379496,
    0.1818289243253687,
    0.15331611722055008,
    0.14617807153417325,
)


def log(x: Double) -> Double:
    """Natural logarithm: -inf of zero, NaN of negative numbers."""
    mantissa, k = split(x)
    value = _sum(mantissa - 1.0, None, to_double(k))
    return _at_the_ends(x, value)


def near_log(x: Double) -> Double:
    """The natural logarithm of a positive normal number."""
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
    """log((x + low) 2^doublings) of an x from one on and a much smaller `low`."""
    mantissa, k = mantissa_and_exponent(x, SQRT_HALF)
    low = low * power_of_two(-lax.min(k, lax.full_like(k, 1000)))
    return _sum(mantissa - 1.0, low, to_double(k + doublings))


def split(x: Double) -> tuple[Double, Integer]:
    """The mantissa from sqrt(1/2) to sqrt(2) and the exponent of any positive x."""
    tiny = x < MIN_NORMAL
    mantissa, k = mantissa_and_exponent(select(tiny, x * 2.0**54, x), SQRT_HALF)
    return mantissa, k - lax.select(tiny, lax.full_like(k, 54), lax.full_like(k, 0))


def _sum(f: Double, lost: Double | None, k: Double) -> Double:
    """log(1 + f + lost) + k log(2); `lost` is None for nothing."""
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
    """The logarithm of zero, negative numbers, infinity and NaN beside the usual value."""
    below = select(x == 0.0, -np.inf, np.nan)
    return select((x > 0.0) & (x < np.inf), value, select(x == np.inf, np.inf, below))
