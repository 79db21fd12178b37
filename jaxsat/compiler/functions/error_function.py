"""The error function, its complement and its inverse.

erfc(x) = exp(-x^2) g(t)/(1 + 2 x) of x from 1/2 on, with a smooth g of t = (x - 4)/(x + 4), after
Shepherd and Laframboise, Mathematics of Computation 36 (1981) 249-253; erf(x)/x is a polynomial in
x^2 where x is small. The inverse is after Giles, GPU Computing Gems Jade (2011) 109-116:
erf_inv(x)/x is smooth in w = -log(1 - x^2), and in sqrt(w) where w is large: one polynomial each.
"""

import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxsat.compiler.functions.bits import (
    Double,
    Truth,
    fast_two_sum,
    fitted,
    horner,
    polynomial,
    quotient,
    scaled,
    select,
    upper,
    with_sign_of,
)
from jaxsat.compiler.functions.exponential import bounded, exp_pair, log, near_log

_TAIL_BEGINS = 0.0019304541362277093
"""1 - x^2 of which -log is 6.25."""
_ERF_INV_CENTRAL = fitted("ERF_INV_CENTRAL")
_ERF_INV_TAIL = fitted("ERF_INV_TAIL")
_ERROR_FUNCTION = fitted("ERROR_FUNCTION")
_ERROR_COMPLEMENT = fitted("ERROR_COMPLEMENT")


def erf(x: Double) -> Double:
    """Error function."""
    size = lax.abs(x)
    far = 1.0 - _complement(size)
    return with_sign_of(select(size < 0.9, _near_zero(size), far), x)


def erfc(x: Double) -> Double:
    """Complementary error function, 1 - erf, accurate where it is small."""
    far = _complement(lax.abs(x))
    near = 1.0 - _near_zero(x)
    return select(lax.abs(x) < 0.5, near, select(x < 0.0, 2.0 - far, far))


def _near_zero(x: Double) -> Double:
    """Return the error function of |x| < 0.9."""
    return x + x * polynomial(x * x, _ERROR_FUNCTION)


def _complement(x: Double) -> Double:
    """Return the complement for x from 1/2 on."""
    x = bounded(x, 0.5, 28.0)
    cut = upper(x)
    e, e_low, n = exp_pair(-(cut * cut), -((x - cut) * (x + cut)))
    t = (x - 4.0) / (x + 4.0)
    first = lax.full_like(x, _ERROR_COMPLEMENT[0])
    g, g_low = fast_two_sum(first, t * polynomial(t, _ERROR_COMPLEMENT[1:]))
    den, den_low = fast_two_sum(2.0 * x, lax.full_like(x, 1.0))
    q = quotient(g, g_low, den, den_low)
    # e q, rounded once: the factors' upper parts have an exact product.
    cut, q_cut = upper(e), upper(q)
    value = cut * q_cut + ((e - cut) * q + cut * (q - q_cut) + e_low * q)
    return scaled(value, n)


def erf_inv(x: Double) -> Double:
    """Inverse error function: +-inf of +-1, NaN outside."""
    one_less_square = (1.0 - x) * (1.0 + x)
    w = -log(one_less_square)
    tail = ~(one_less_square > _TAIL_BEGINS) & (w < np.inf)
    central = _in_the_middle(w)
    any_tail = tail if jnp.ndim(tail) == 0 else jnp.any(tail)
    factor = lax.cond(any_tail, lambda: select(tail, _in_the_tail(w), central), lambda: central)
    return select(lax.abs(x) < 1.0, x * factor, x * select(w == np.inf, np.inf, np.nan))


def near_erf_inv(x: Double) -> tuple[Double, Truth]:
    """`erf_inv` in fewer steps, and where it is wrong: in a thousandth of (-1, 1), and outside."""
    one_less_square = (1.0 - x) * (1.0 + x)
    factor = _in_the_middle(-near_log(one_less_square))
    return x * factor, ~(one_less_square > _TAIL_BEGINS)


def _in_the_middle(w: Double) -> Double:
    return horner(w - 3.125, _ERF_INV_CENTRAL)


def _in_the_tail(w: Double) -> Double:
    return horner(lax.sqrt(w) - 4.25, _ERF_INV_TAIL)
