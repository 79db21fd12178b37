"""sin, cos and tan, right for every double."""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    Truth,
    fast_two_sum,
    horner,
    polynomial,
    quotient,
    select,
)
from jaxsat.compiler.functions.reduction import reduced
from jaxsat.core.trigonometry import (
    COSINE,
    NEAR_LIMIT,
    SINE,
    cos_of,
    is_odd,
    reduced_by_half_turns,
    signed,
    sin_of,
)
from jaxsat.core.trigonometry import reduced as near

_HALF_TANGENT = (
    0.3333333333333333,
    0.13333333333333436,
    0.0539682539680362,
    0.021869488554173044,
    0.008863234774192113,
    0.0035921461983752937,
    0.0014555696265021495,
    0.0005924016954190282,
    0.00022641606815721656,
    0.00013348555538051507,
)


def sin(x: Double) -> Double:
    """Sine."""
    return sincos(x)[0]


def cos(x: Double) -> Double:
    """Cosine."""
    return sincos(x)[1]


def sincos(x: Double) -> tuple[Double, Double]:
    """Sine and cosine, which share everything but the choice at the end."""
    r, low, quadrant = reduced(x)
    z = r * r
    half = 0.5 * z
    near_one = 1.0 - half
    sine = r + (z * r * horner(z, SINE) + low * near_one)
    cosine = near_one + (((1.0 - near_one) - half) + (z * z * horner(z, COSINE) - r * low))
    first, second = _chosen(sine, cosine, quadrant)
    return select(x == 0.0, x, signed(first, quadrant << 62)), second


def near_sincos(x: Double) -> tuple[Double, Double, Truth]:
    """Both in fewer steps, as if alone, one unit in the last place worse; and where it is wrong."""
    sine, wrong = near_sin(x)
    return sine, near_cos(x)[0], wrong


def near_sin(x: Double) -> tuple[Double, Truth]:
    """Sine in fewer steps, valid below a size that is seldom exceeded; and where it is wrong."""
    size = lax.abs(x)
    return sin_of(x, *reduced_by_half_turns(size)), size >= NEAR_LIMIT


def near_cos(x: Double) -> tuple[Double, Truth]:
    """Cosine in the same way."""
    size = lax.abs(x)
    return cos_of(*near(size)), size >= NEAR_LIMIT


def _chosen(sine: Double, cosine: Double, quadrant: Integer) -> tuple[Double, Double]:
    """Sine, without the sign of the quadrant, and cosine of the whole angle."""
    odd = is_odd(quadrant)
    cosine_of_all = signed(select(odd, sine, cosine), (quadrant + np.int64(1)) << 62)
    return select(odd, cosine, sine), cosine_of_all


def tan(x: Double) -> Double:
    """Tangent, by that of half the reduced angle: 2 t/(1 - t^2) or its negative inverse."""
    r, low, quadrant = reduced(x)
    half = 0.5 * r
    z = half * half
    rest = half * z * polynomial(z, _HALF_TANGENT) + 0.5 * low
    double, double_low = fast_two_sum(r, 2.0 * rest)
    tangent = half + rest
    square = tangent * tangent
    one_less, one_less_low = fast_two_sum(lax.full_like(x, 1.0), -square)
    odd = is_odd(quadrant)
    num = select(odd, -one_less, double)
    num_low = select(odd, -one_less_low, double_low)
    den = select(odd, double, one_less)
    den_low = select(odd, double_low, one_less_low)
    return select(x == 0.0, x, quotient(num, num_low, den, den_low))
