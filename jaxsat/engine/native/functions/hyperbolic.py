"""sinh, cosh and tanh: of exp where they are large, polynomials where they are small."""

from jax import lax

from jaxsat.engine.native.functions.bits import Double, polynomial, scaled, select, with_sign_of
from jaxsat.engine.native.functions.exponential import bounded, exp_parts

_TANGENT_HYPERBOLIC = (
    -0.3333333333333333,
    0.13333333333332714,
    -0.053968253967434016,
    0.021869488493666944,
    -0.008863234397814355,
    0.003592110378689024,
    -0.001455661830100716,
    0.0005889360520074057,
    -0.0002346347410887237,
    8.511313685577672e-05,
    -2.060276537636634e-05,
)
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
    """Hyperbolic tangent."""
    size = lax.abs(x)
    e = scaled(*exp_parts(bounded(2.0 * size, 0.0, 50.0)))
    z = x * x
    small = size + size * (z * polynomial(z, _TANGENT_HYPERBOLIC))
    return with_sign_of(select(size < 0.55, small, 1.0 - 2.0 / (e + 1.0)), x)


def _half_exp(x: Double) -> Double:
    """exp(|x|)/2, finite wherever sinh is."""
    e, n = exp_parts(bounded(lax.abs(x), 0.0, 711.0))
    return scaled(e, n - 1)
