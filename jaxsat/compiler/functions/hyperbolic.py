"""sinh, cosh and tanh, of exp; sinh by a polynomial where it is small."""

from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    fast_two_sum,
    polynomial,
    scaled,
    select,
    with_sign_of,
)
from jaxsat.compiler.functions.exponential import bounded, exp_parts, expm1_pair

_SINE_HYPERBOLIC = (
    0.16666666666666666,
    0.008333333333333333,
    0.00019841269841269773,
    2.755731922404034e-06,
    2.505210836405804e-08,
    1.6059046398350562e-10,
    7.646625361656657e-13,
    2.8445264169895285e-15,
)


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

    Where t < 2, what the roundings of t and t + 2 change is put back; 1/(t + 2) is half of
    1 - tanh.
    """
    size = lax.abs(x)
    t, t_low = expm1_pair(2.0 * select(size > 20.0, 20.0, size))
    whole, whole_low = fast_two_sum(lax.full_like(t, 2.0), t)
    found = t / whole
    correction = (t_low - whole_low * found) * (0.5 - 0.5 * found)
    return with_sign_of(found + select(t < 2.0, correction, 0.0), x)


def _half_exp(x: Double) -> Double:
    """exp(|x|)/2, finite wherever sinh is."""
    e, n = exp_parts(bounded(lax.abs(x), 0.0, 711.0))
    return scaled(e, n - 1)
