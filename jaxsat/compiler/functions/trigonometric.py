"""sin, cos and tan, accurate for every double; their inverses, one polynomial each.

Angles are reduced by multiples of pi/2, correct to the last bit for every double. Below 2^20: Cody
and Waite with pi/2 in four pieces, the first three of 33 bits, so that their products with the
multiple are exact (as in fdlibm's e_rem_pio2.c, Sun Microsystems, 1993). Above: Payne and Hanek,
SIGNUM Newsletter 18 (1983) 19-24, in 64-bit integers.
"""

from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Integer,
    Truth,
    bits_of,
    double_of,
    fast_two_sum,
    fitted,
    horner,
    negative,
    polynomial,
    quotient,
    rounded,
    select,
    shift_right,
    upper,
    with_sign_of,
)
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


_LIMIT = 2.0**20
_TWO_OVER_PI = 2 / np.pi
_PIECES = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487111665e-21, 8.4784276603689e-32)
_HALF_PI_UPPER, _HALF_PI_REST = 1.5707963109016418, 1.5893254773528196e-08
_HALF_PI = 1.5707963267948966

# The bits of 2/pi after the point, 64 zeros before them.
_TWO_OVER_PI_BITS = tuple(
    np.uint64(word).view(np.int64)
    for word in (
        0x0000000000000000, 0xA2F9836E4E441529, 0xFC2757D1F534DDC0, 0xDB6295993C439041,
        0xFE5163ABDEBBC561, 0xB7246E3A424DD2E0, 0x06492EEA09D1921C, 0xFE1DEB1CB129A73E,
        0xE88235F52EBB4484, 0xE99C7026B45F7E41, 0x3991D639835339F4, 0x9C845F8BBDF9283B,
        0x1FF897FFDE05980F, 0xEF2F118B5A0A6D1F, 0x6D367ECF27CB09B7, 0x4F463F669E5FEA2D,
        0x7527BAC7EBE5F17B, 0x3D0739F78A5292EA, 0x6BFB5FB11F8D5D08, 0x56033046FC7B6BAB,
    )
)  # fmt: skip


def reduced(x: Double) -> tuple[Double, Double, Integer]:
    """Return r, its rounding error and the multiple q mod 4 of x = q pi/2 + r, |r| <= pi/4.

    NaN for infinite or NaN x. The wide reduction runs where any element needs it.
    """
    wide = _is_wide(x)
    if jnp.ndim(wide) == 0:
        return lax.cond(wide, _far, _narrow, x)
    return lax.cond(jnp.any(wide), _any, _narrow, x)


def _is_wide(x: Double) -> Truth:
    size = lax.abs(x)
    return (size >= _LIMIT) & (size < np.inf)


def _narrow(x: Double) -> tuple[Double, Double, Integer]:
    """Reduce |x| < 2^20. Differences are exact, or their errors are used further."""
    multiple, whole = rounded(x * _TWO_OVER_PI)
    first, second, third, last = _PIECES
    y = x - multiple * first
    total = y - multiple * second
    error = (y - total) - multiple * second
    fine = total - multiple * third
    error = (error + ((total - fine) - multiple * third)) - multiple * last
    r, low = fast_two_sum(fine, error)
    return r, low, whole & np.int64(3)


def _any(x: Double) -> tuple[Double, Double, Integer]:
    """Reduce widely where needed, narrowly elsewhere."""
    wide = _is_wide(x)
    far, near = _far(select(wide, x, 1.0)), _narrow(select(wide, 1.0, x))
    r, low = (select(wide, f, n) for f, n in zip(far[:2], near[:2], strict=True))
    return r, low, lax.select(wide, far[2], near[2])


def _far(x: Double) -> tuple[Double, Double, Integer]:
    """Reduce widely, for both signs."""
    r, low, multiple = _wide(lax.abs(x))
    sign = select(negative(x), -1.0, 1.0)
    quadrant = lax.select(negative(x), -multiple, multiple) & np.int64(3)
    return sign * r, sign * low, quadrant


def _wide(x: Double) -> tuple[Double, Double, Integer]:
    """Reduce positive x of at least 2^-1 in fixed point: two bits of quadrant, 126 of fraction."""
    bits = bits_of(x)
    mantissa = (bits & np.int64(2**52 - 1)) | np.int64(2**52)
    # x = mantissa 2^e; bits of 2/pi that weigh 4 and more times it make whole turns.
    start = (bits >> 52) - np.int64(1075 - 62)
    high, middle, low = _window(start)
    upper_product, _ = _wide_product(mantissa, middle)
    carried, _ = _wide_product(mantissa, low)
    fraction_low = carried + mantissa * middle
    carry = _unsigned_less(fraction_low, carried).astype(jnp.int64)
    fraction_high = upper_product + mantissa * high + carry
    quadrant = shift_right(fraction_high + np.int64(2**61), 62)
    r, rest = _times_half_pi(fraction_high - (quadrant << 62), fraction_low)
    return r, rest, quadrant


def _window(start: Integer) -> tuple[Integer, Integer, Integer]:
    """Return 192 bits of 2/pi from bit `start`."""
    table, first = jnp.asarray(_TWO_OVER_PI_BITS), (start >> 6).astype(jnp.int32)
    words = [
        table.at[first + np.int32(i)].get(mode="promise_in_bounds", wrap_negative_indices=False)
        for i in range(4)
    ]
    shift = start & np.int64(63)
    rest = np.int64(63) - shift
    high, middle, low = (
        (a << shift) | lax.shift_right_logical(shift_right(b, 1), rest) for a, b in pairwise(words)
    )
    return high, middle, low


def _wide_product(x: Integer, y: Integer) -> tuple[Integer, Integer]:
    """Return the upper and lower 64 bits of a product of unsigned words, x below 2^53."""
    lower = np.int64(2**32 - 1)
    x_high, x_low = shift_right(x, 32), x & lower
    y_high, y_low = shift_right(y, 32), y & lower
    across = x_high * y_low + shift_right(x_low * y_low, 32)
    other = x_low * y_high + (across & lower)
    return x_high * y_high + shift_right(across, 32) + shift_right(other, 32), x * y


def _unsigned_less(x: Integer, y: Integer) -> Truth:
    sign = np.int64(-(2**63))
    return (x ^ sign) < (y ^ sign)


def _times_half_pi(high: Integer, low: Integer) -> tuple[Double, Double]:
    """Return a signed fraction of 126 bits after the point, times pi/2, with its rounding error."""
    minus = high < 0
    borrow = (low == 0).astype(jnp.int64)
    high = lax.select(minus, ~high + borrow, high)
    low = lax.select(minus, -low, low)
    lower = np.int64(2**32 - 1)
    parts = shift_right(high, 32), high & lower, shift_right(low, 32), low & lower
    weights = 2.0**-30, 2.0**-62, 2.0**-94, 2.0**-126
    top, second, third, last = (
        _word_to_double(part) * weight for part, weight in zip(parts, weights, strict=True)
    )
    total, error = fast_two_sum(top, second)
    total, error = fast_two_sum(total, error + (third + last))
    cut = upper(total)
    product = cut * _HALF_PI_UPPER
    rest = cut * _HALF_PI_REST + ((total - cut) + error) * _HALF_PI
    r, rest = fast_two_sum(product, rest)
    sign = select(minus, -1.0, 1.0)
    return sign * r, sign * rest


def _word_to_double(word: Integer) -> Double:
    return double_of(word | np.int64(0x433 << 52)) - 2.0**52
