"""Elementary functions by mpmath and NumPy, and errors in units in the last place."""

import math
from typing import NamedTuple

import mpmath as mp
import numpy as np
import scipy.special

mp.mp.dps = 40


def _logistic(x):
    return 1 / (1 + mp.exp(-x))


def _real(function):
    def real(x):
        value = function(x)
        return value if mp.im(value) == 0 else mp.nan

    return real


def _power(x, y):
    value = mp.power(x, y)
    return value if mp.im(value) == 0 else mp.nan


REFERENCES = {
    "acos": mp.acos,
    "acosh": _real(mp.acosh),
    "asin": mp.asin,
    "asinh": mp.asinh,
    "atan": mp.atan,
    "atan2": mp.atan2,
    "atanh": _real(mp.atanh),
    "cbrt": lambda x: mp.sign(x) * mp.cbrt(abs(x)),
    "cos": mp.cos,
    "cosh": mp.cosh,
    "erf": mp.erf,
    "erf_inv": mp.erfinv,
    "erfc": mp.erfc,
    "exp": mp.exp,
    "exp2": lambda x: mp.mpf(2) ** x,
    "expm1": mp.expm1,
    "log": mp.log,
    "log1p": mp.log1p,
    "logistic": _logistic,
    "pow": _power,
    "sin": mp.sin,
    "sinh": mp.sinh,
    "tan": mp.tan,
    "tanh": mp.tanh,
}

NUMPY = {
    "acos": np.arccos,
    "acosh": np.arccosh,
    "asin": np.arcsin,
    "asinh": np.arcsinh,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "atanh": np.arctanh,
    "cbrt": np.cbrt,
    "cos": np.cos,
    "cosh": np.cosh,
    "erf": scipy.special.erf,
    "erfc": scipy.special.erfc,
    "exp": np.exp,
    "exp2": np.exp2,
    "expm1": np.expm1,
    "log": np.log,
    "log1p": np.log1p,
    "pow": np.power,
    "sin": np.sin,
    "sinh": np.sinh,
    "tan": np.tan,
    "tanh": np.tanh,
}


class Exact(NamedTuple):
    """Exact values as the nearest doubles and what these lack, in units in their last place."""

    nearest: np.ndarray
    rest: np.ndarray


def exact_values(name: str, arguments: tuple[np.ndarray, ...]) -> Exact:
    rows = zip(*(x.tolist() for x in arguments), strict=True)
    if name == "pow":
        # An exponent of 1e9 costs nine digits of the logarithm.
        with mp.workdps(60):
            values = [_bounded_power(x, y) for x, y in rows]
    else:
        values = [REFERENCES[name](*map(mp.mpf, row)) for row in rows]
    nearest = np.array([float(value) for value in values])
    rest = np.zeros(nearest.size)
    for i in np.flatnonzero(np.isfinite(nearest)):
        near = float(nearest[i])
        rest[i] = float((values[i] - near) / math.ulp(near))
    return Exact(nearest, rest)


def _bounded_power(x: float, y: float) -> mp.mpf:
    if x < 0 and y != np.floor(y):
        return mp.nan
    with np.errstate(all="ignore"):
        if x == 0 or abs(y * np.log(abs(x))) > 2000:
            return mp.mpf(float(np.power(x, y)))
    return _power(mp.mpf(x), mp.mpf(y))


def errors_in_ulps(values: np.ndarray, exact: Exact, smallest: float = 0.0) -> np.ndarray:
    """Errors in units in the last place; results of less than `smallest` pass."""
    nearest, rest = exact
    limit = np.finfo(float).max
    with np.errstate(all="ignore"):
        errors = np.abs((values - nearest) / np.spacing(np.abs(nearest)) - rest)
        overflown = np.where(np.abs(nearest) >= limit * (1 - 2**-52), 1.0, np.inf)
    errors = np.where(np.isfinite(values), errors, overflown)
    same = (values == nearest) | (np.isnan(values) & np.isnan(nearest))
    errors = np.where(np.isfinite(nearest), errors, np.where(same, 0.0, np.inf))
    return np.where(np.abs(nearest) < smallest, 0.0, errors)
