"""sinh, cosh and tanh, of exp, and their inverses, of logarithms; polynomials where they are small.

A sum like x + sqrt(1 + x^2) needs more than a double, for its error is that of the logarithm.
"""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    fast_two_sum,
    fitted,
    polynomial,
    quotient,
    scaled,
    select,
    upper,
    with_sign_of,
)
from jaxsat.compiler.functions.exponential import bounded, exp_parts, expm1_pair, log_of_pair

_SINE_HYPERBOLIC = fitted("SINE_HYPERBOLIC")
_ARC_SINE_HYPERBOLIC = fitted("ARC_SINE_HYPERBOLIC")
_ARC_COSINE_HYPERBOLIC = fitted("ARC_COSINE_HYPERBOLIC")
_ARC_TANGENT_HYPERBOLIC = fitted("ARC_TANGENT_HYPERBOLIC")


def sinh(x: Double) -> Double:
    """Hyperbolic sine."""
    half = _half_exp(x)
    size, z = lax.abs(x), x * x
    small = size + size * (z * polynomial(z, _SINE_HYPERBOLIC))
    return with_sign_of(select(size < 1.0, small, half - 0.25 / half), x)


def cosh(x: Double) -> Double:
    """Hyperbolic cosine."""
    half = _half_exp(x)
    return half + 0.25 / half


def tanh(x: Double) -> Double:
    """Hyperbolic tangent: t/(t + 2) with t = exp(2 |x|) - 1.

    Where t < 2, the effect of rounding t and t + 2 is corrected; 1/(t + 2) is half of 1 - tanh.
    """
    size = lax.abs(x)
    t, t_low = expm1_pair(2.0 * select(size > 20.0, 20.0, size))
    whole, whole_low = fast_two_sum(lax.full_like(t, 2.0), t)
    quotient = t / whole
    correction = (t_low - whole_low * quotient) * (0.5 - 0.5 * quotient)
    return with_sign_of(quotient + select(t < 2.0, correction, 0.0), x)


def _half_exp(x: Double) -> Double:
    """Return exp(|x|)/2, finite wherever sinh is."""
    e, n = exp_parts(bounded(lax.abs(x), 0.0, 711.0))
    return scaled(e, n - 1)


_LARGE = 2.0**28
"""Size of x from which the root is x itself."""


def asinh(x: Double) -> Double:
    """Inverse hyperbolic sine."""
    size = lax.abs(x)
    z = x * x
    small = size + size * (z * polynomial(z, _ARC_SINE_HYPERBOLIC))
    far = _log_of_sum_with_root(size, 1.0)
    return with_sign_of(select(size < 0.5, small, far), x)


def acosh(x: Double) -> Double:
    """Inverse hyperbolic cosine; NaN below one."""
    d = x - 1.0
    root = lax.sqrt(2.0 * d)
    near = root + root * (d * polynomial(d, _ARC_COSINE_HYPERBOLIC))
    value = select(d < 0.5, near, _log_of_sum_with_root(x, -1.0))
    return select(x >= 1.0, value, np.nan)


def atanh(x: Double) -> Double:
    """Inverse hyperbolic tangent: infinite at -1 and 1, NaN outside."""
    size = lax.abs(x)
    z = x * x
    small = size + size * (z * polynomial(z, _ARC_TANGENT_HYPERBOLIC))
    inside = select((size >= 0.5) & (size < 1.0), size, 0.5)
    num, num_low = fast_two_sum(lax.full_like(x, 1.0), inside)
    ratio = quotient(num, num_low, 1.0 - inside, 0.0)
    nothing = lax.full_like(x, 0.0)
    far = 0.5 * log_of_pair(ratio, nothing, _whole(x, 0))
    ends = select(size == 1.0, np.inf, np.nan)
    value = select(size < 0.5, small, select(size < 1.0, far, ends))
    return with_sign_of(value, x)


def _log_of_sum_with_root(x: Double, one: float) -> Double:
    """Return log(x + sqrt(x^2 + one)) of x from 1/2 or, with -1, from 3/2."""
    large = x > _LARGE
    size = select(large | (x < 0.5), 2.0, x)
    cut = upper(size)
    square, rest = cut * cut, (size - cut) * (size + cut)
    above = square > 1.0
    total, error = fast_two_sum(select(above, square, one), select(above, one, square))
    w = total + (error + rest)
    w_low = (total - w) + (error + rest)
    root = lax.sqrt(w)
    cut = upper(root)
    lost = ((w - cut * cut) - (root - cut) * (root + cut) + w_low) / (2.0 * root)
    first, second = (root, size) if one > 0.0 else (size, root)
    total, error = fast_two_sum(first, second)
    total = select(large, select(x < np.inf, x, 1.0), total)
    doubled = lax.select(large, _whole(x, 1), _whole(x, 0))
    value = log_of_pair(total, select(large, 0.0, error + lost), doubled)
    return select(x < np.inf, value, x)


def _whole(like: Double, number: int) -> Integer:
    return lax.full_like(like, number, np.int64)
