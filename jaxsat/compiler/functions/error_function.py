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
_ERF_INV_CENTRAL = (
    1.6536545626831027,
    0.2401581824255883,
    -0.00603367087142785,
    -0.000740702534154477,
    0.00018673420802464837,
    -1.3882523394405316e-05,
    -1.3654691850603575e-06,
    4.234788173782339e-07,
    -2.9070382262927266e-08,
    -4.11266082002324e-09,
    1.0512181539804126e-09,
    -5.414287198084716e-11,
    -1.2976885526532075e-11,
    2.6304834740560442e-12,
    -8.118399443074353e-14,
    -4.001237735091896e-14,
    6.596407712420834e-15,
    -4.0282154327661744e-17,
    -1.3016928016796445e-16,
    1.557432024623325e-17,
    1.150022252066253e-18,
    -3.4996044354754177e-19,
    -1.113483769832702e-21,
    3.240704459379902e-21,
)
_ERF_INV_TAIL = (
    4.09222342366813,
    1.0099782771612558,
    0.0007127499726626185,
    -0.0006078940274765566,
    0.00021217671319391596,
    -6.441975053297729e-05,
    2.198012900069531e-05,
    -1.0197666555200082e-05,
    5.807264204297037e-06,
    -3.2111215390861817e-06,
    1.4901865630058147e-06,
    -5.152772300517454e-07,
    9.326993878130323e-08,
    2.56386262222445e-08,
    -3.011757154847692e-08,
    1.3408925082792506e-08,
    -3.0875208407266895e-09,
    -1.680050762462941e-10,
    4.743241231728028e-10,
    -1.9834532448755954e-10,
    2.9162360485261394e-11,
    6.814431007844277e-12,
    -2.7745339835512677e-12,
    5.323024690642685e-13,
    -5.492911836966747e-13,
    1.5526592086754748e-13,
    5.892657739136106e-14,
    -2.567988726420779e-14,
    -1.1328666815493932e-15,
    9.663298125055326e-16,
)

_ERROR_FUNCTION = (
    0.1283791670955126,
    -0.3761263890318373,
    0.11283791670953792,
    -0.0268661706448234,
    0.005223977621766896,
    -0.000854832676425319,
    0.00012055321374349772,
    -1.4925307337159171e-05,
    1.645532564924694e-06,
    -1.627649674520215e-07,
    1.4051319281278355e-08,
    -8.493614638206203e-10,
)
_ERROR_COMPLEMENT = (
    1.2329951186255526,
    -0.1396211168405625,
    0.015379652102620016,
    0.06809705425469167,
    -0.10103906603632291,
    0.09373283499839087,
    -0.0663303658117169,
    0.03716751553674045,
    -0.01619773406478615,
    0.005031969984903767,
    -0.0007577732313932441,
    -0.00019925673017349798,
    0.00015062138429759874,
    -2.439911587480824e-05,
    -1.1221082204951293e-05,
    5.709619988958958e-06,
    2.9184757551006604e-07,
    -8.255332077342601e-07,
    7.714500146709343e-08,
    1.1055949407972104e-07,
    -1.9735894361975644e-08,
    -1.4704981949994096e-08,
    2.409161671732903e-09,
    1.5220526329972264e-09,
)


def erf(x: Double) -> Double:
    """Error function."""
    size = lax.abs(x)
    far = 1.0 - _complement(size)
    return with_sign_of(select(size < 0.9, _near_zero(size), far), x)


def erfc(x: Double) -> Double:
    """One less the error function, accurate where that is small."""
    far = _complement(lax.abs(x))
    near = 1.0 - _near_zero(x)
    return select(lax.abs(x) < 0.5, near, select(x < 0.0, 2.0 - far, far))


def _near_zero(x: Double) -> Double:
    """The error function of |x| < 0.9."""
    return x + x * polynomial(x * x, _ERROR_FUNCTION)


def _complement(x: Double) -> Double:
    """The complement for x from 1/2 on."""
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
    """The same in fewer steps; and where it is wrong: in a thousandth of (-1, 1), and outside."""
    one_less_square = (1.0 - x) * (1.0 + x)
    factor = _in_the_middle(-near_log(one_less_square))
    return x * factor, ~(one_less_square > _TAIL_BEGINS)


def _in_the_middle(w: Double) -> Double:
    return horner(w - 3.125, _ERF_INV_CENTRAL)


def _in_the_tail(w: Double) -> Double:
    return horner(lax.sqrt(w) - 4.25, _ERF_INV_TAIL)
