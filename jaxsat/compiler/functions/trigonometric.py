"""sin, cos and tan, accurate for every double; their inverses, one polynomial each."""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    Truth,
    bits_of,
    fast_two_sum,
    fitted,
    horner,
    negative,
    polynomial,
    quotient,
    select,
    upper,
    with_sign_of,
)
from jaxsat.compiler.functions.reduction import reduced
from jaxsat.core.trigonometry import COSINE, NEAR_LIMIT, SINE, is_odd, signed
from jaxsat.core.trigonometry import reduced as near

_HALF_TANGENT = fitted("HALF_TANGENT")
_ARCTANGENT = fitted("ARCTANGENT")
_ARCSINE = fitted("ARCSINE")


def sin(x: Double) -> Double:
    """Sine."""
    return sincos(x)[0]


def cos(x: Double) -> Double:
    """Cosine."""
    return sincos(x)[1]


def sincos(x: Double) -> tuple[Double, Double]:
    """Sine and cosine, which share everything but the selection at the end."""
    r, low, quadrant = reduced(x)
    z = r * r
    half = 0.5 * z
    near_one = 1.0 - half
    sine = r + (z * r * horner(z, SINE) + low * near_one)
    cosine = near_one + (((1.0 - near_one) - half) + (z * z * horner(z, COSINE) - r * low))
    first, second = _chosen(sine, cosine, quadrant)
    return select(x == 0.0, x, signed(first, quadrant << 62)), second


def near_sincos(x: Double) -> tuple[Double, Double, Truth]:
    """Sine and cosine in fewer steps, one ulp less accurate, and where they are wrong.

    They are right below a size that is seldom exceeded. One alone needs all steps but a selection
    and a sign, so it has the same bits whether or not a program also needs the other.
    """
    size = lax.abs(x)
    r, quadrant = near(size)
    z = r * r
    sine = r + z * r * horner(z, SINE)
    cosine = horner(z, (1.0, -0.5, *COSINE))
    first, second = _chosen(sine, cosine, quadrant)
    return signed(first, (quadrant << 62) ^ bits_of(x)), second, size >= NEAR_LIMIT


def _chosen(sine: Double, cosine: Double, quadrant: Integer) -> tuple[Double, Double]:
    """Return sine, without the sign of the quadrant, and cosine of the whole angle."""
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


# pi/4 = _QUARTER + _QUARTER_LOW; its multiples by 2 and 4 round to what is used below.
_QUARTER, _QUARTER_LOW = 0.7853981633974483, 3.061616997868383e-17
_TANGENT_OF_EIGHTH = 0.41421356237309503


def asin(x: Double) -> Double:
    """Arc sine; NaN outside [-1, 1]."""
    large, angle = _arcsine(x)
    far = 2.0 * _QUARTER - (2.0 * angle - 2.0 * _QUARTER_LOW)
    return with_sign_of(select(large, far, angle), x)


def acos(x: Double) -> Double:
    """Arc cosine; NaN outside [-1, 1]."""
    large, angle = _arcsine(x)
    minus = negative(x)
    near = 2.0 * _QUARTER - (select(minus, -angle, angle) - 2.0 * _QUARTER_LOW)
    far = select(minus, 4.0 * _QUARTER - (2.0 * angle - 4.0 * _QUARTER_LOW), 2.0 * angle)
    return select(large, far, near)


def atan(x: Double) -> Double:
    """Arc tangent."""
    return atan2(x, lax.full_like(x, 1.0))


def atan2(y: Double, x: Double) -> Double:
    """Angle of the point (x, y) in all four quadrants, with the signs of zero."""
    rise, run = lax.abs(y), lax.abs(x)
    steep = rise > run
    small, large = select(steep, run, rise), select(steep, rise, run)
    infinite = large == np.inf
    small = select(infinite, select(small == np.inf, 1.0, 0.0), small)
    large = select(infinite, 1.0, large)
    scale = select(large > 2.0**1000, 2.0**-60, select(large < 2.0**-700, 2.0**200, 1.0))
    small, large = small * scale, select(large == 0.0, 1.0, large * scale)
    angle = _angle(small, large, steep, negative(x))
    return with_sign_of(select((x != x) | (y != y), np.nan, angle), y)


def near_atan2(y: Double, x: Double) -> tuple[Double, Truth]:
    """`atan2` in fewer steps, and where it is wrong: at the origin and at numbers far from one."""
    rise, run = lax.abs(y), lax.abs(x)
    steep = rise > run
    small, large = select(steep, run, rise), select(steep, rise, run)
    angle = _angle(small, large, steep, negative(x))
    return with_sign_of(angle, y), ~((large > 2.0**-700) & (large < 2.0**1000))


def _angle(small: Double, large: Double, steep: Truth, back: Truth) -> Double:
    """Return the angle from 0 to pi of a point at `small` and `large` distances from the axes."""
    # Beyond pi/8 the angle is taken from the diagonal.
    middle = small > _TANGENT_OF_EIGHTH * large
    num = select(middle, small - large, small)
    t = num / select(middle, small + large, large)
    z = t * t
    base, base_low = select(middle, _QUARTER, 0.0), select(middle, _QUARTER_LOW, 0.0)
    angle = base + (t + (t * (z * horner(z, _ARCTANGENT)) + base_low))
    angle = select(steep, 2.0 * _QUARTER - angle, angle)
    return select(back, 4.0 * _QUARTER - angle, angle)


def _arcsine(x: Double) -> tuple[Truth, Double]:
    """Return whether |x| > 1/2, and asin of |x| or, if so, of sqrt((1 - |x|)/2)."""
    size = lax.abs(x)
    large = size > 0.5
    rest = 0.5 * (1.0 - size)
    z = select(large, rest, x * x)
    root = lax.sqrt(rest)
    cut = upper(root)
    lost = ((rest - cut * cut) - (root - cut) * (root + cut)) / (2.0 * root + 2.0**-500)
    s, low = select(large, root, size), select(large, lost, 0.0)
    return large, s + (low + s * (z * polynomial(z, _ARCSINE)))
