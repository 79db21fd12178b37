"""asin, acos, atan and atan2: one polynomial each, no branches."""

import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Truth,
    horner,
    negative,
    polynomial,
    select,
    upper,
    with_sign_of,
)

# pi/4 = _QUARTER + _QUARTER_LOW; its multiples by 2 and 4 round to what is used below.
_QUARTER, _QUARTER_LOW = 0.7853981633974483, 3.061616997868383e-17
_TANGENT_OF_EIGHTH = 0.41421356237309503

_ARCTANGENT = (
    -0.3333333333333333,
    0.1999999999999548,
    -0.14285714284657894,
    0.11111111014561013,
    -0.09090904549884611,
    0.07692182535116648,
    -0.06664502215671447,
    0.058580687568615106,
    -0.05085030492810941,
    0.03921955253255129,
    -0.019162068915902573,
)
_ARCSINE = (
    0.16666666666666669,
    0.07499999999998425,
    0.04464285714637338,
    0.030381944137085216,
    0.022372173002005596,
    0.017352391265909227,
    0.013971235301124539,
    0.011478952690257387,
    0.010324318288744113,
    0.00545087818772055,
    0.017419357964884856,
    -0.014881409392818066,
    0.02877844261259304,
)


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
    """The angle of the point (x, y), in all four quadrants, signs of zero obeyed."""
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
    """The same in fewer steps; and where it is wrong: at the origin and at numbers far from one."""
    rise, run = lax.abs(y), lax.abs(x)
    steep = rise > run
    small, large = select(steep, run, rise), select(steep, rise, run)
    angle = _angle(small, large, steep, negative(x))
    return with_sign_of(angle, y), ~((large > 2.0**-700) & (large < 2.0**1000))


def _angle(small: Double, large: Double, steep: Truth, back: Truth) -> Double:
    """The angle from 0 to pi of a point at `small` and `large` distances from the axes."""
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
    """Whether |x| > 1/2, and asin of |x| or, where it is, of sqrt((1 - |x|)/2)."""
    size = lax.abs(x)
    large = size > 0.5
    rest = 0.5 * (1.0 - size)
    z = select(large, rest, x * x)
    root = lax.sqrt(rest)
    cut = upper(root)
    lost = ((rest - cut * cut) - (root - cut) * (root + cut)) / (2.0 * root + 2.0**-500)
    s, low = select(large, root, size), select(large, lost, 0.0)
    return large, s + (low + s * (z * polynomial(z, _ARCSINE)))
