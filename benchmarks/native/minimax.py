"""Derive the coefficients of jaxsat's elementary functions, in 60-digit arithmetic.

    python benchmarks/native/minimax.py [name ...]

Each row of `FITS` is a function, its interval and the number of coefficients. `mpmath.chebyfit`
gives the polynomial of the Chebyshev expansion, within a small factor of the minimax error. Printed
are the coefficients, lowest power first, as `coefficients.toml` of `jaxsat.compiler.functions` has
them, and the error of the fit.
"""

import sys
from collections.abc import Callable

import mpmath as mp

mp.mp.dps = 60


def _of_square(odd: Callable, first: int) -> Callable:
    """(f(s)/s - 1)/z, z = s^2: what an odd function of unit slope adds to its argument."""

    def value(z: mp.mpf) -> mp.mpf:
        if abs(z) < mp.mpf(10) ** -20:
            z = mp.mpf(10) ** -20
        s = mp.sqrt(z)
        return (odd(s) / s - first) / z

    return value


def _cosine(z: mp.mpf) -> mp.mpf:
    z = max(z, mp.mpf(10) ** -12)
    return (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2


def _exponential(r: mp.mpf) -> mp.mpf:
    if abs(r) < mp.mpf(10) ** -15:
        return mp.mpf(1) / 2 + r / 6
    return (mp.expm1(r) - r) / r**2


def _logarithm(z: mp.mpf) -> mp.mpf:
    """What (log((1 + s)/(1 - s)) - 2 s)/s is, over z = s^2."""
    z = max(z, mp.mpf(10) ** -20)
    s = mp.sqrt(z)
    return (2 * mp.atanh(s) / s - 2) / z


def _logarithm_rest(z: mp.mpf) -> mp.mpf:
    z = max(z, mp.mpf(10) ** -15)
    return (_logarithm(z) - mp.mpf(2) / 3) / z


def _erf_inv_central(w: mp.mpf) -> mp.mpf:
    """erf_inv(x)/x as a function of w = -log(1 - x^2)."""
    w = max(w, mp.mpf(10) ** -20)
    x = mp.sqrt(-mp.expm1(-w))
    return mp.erfinv(x) / x


def _erf_inv_tail(s: mp.mpf) -> mp.mpf:
    """erf_inv(x)/x as a function of s = sqrt(-log(1 - x^2)), by Newton's method on erfc."""
    w = s * s
    x = mp.sqrt(-mp.expm1(-w))
    complement = mp.exp(-w) / (1 + x)
    y = s
    for _ in range(60):
        step = (mp.erfc(y) - complement) * mp.sqrt(mp.pi) / 2 * mp.exp(y * y)
        y += step
        if abs(step) < mp.mpf(10) ** -50:
            break
    return y / x


def _error_function(z: mp.mpf) -> mp.mpf:
    """erf(x)/x - 1 as a function of z = x^2."""
    x = mp.sqrt(max(z, mp.mpf(10) ** -40))
    return mp.erf(x) / x - 1


def _error_complement(t: mp.mpf) -> mp.mpf:
    """(1 + 2 x) exp(x^2) erfc(x) as a function of t = (x - 4)/(x + 4)."""
    x = 4 * (1 + t) / (1 - t)
    return (1 + 2 * x) * mp.exp(x * x) * mp.erfc(x)


def _arc_cosine(d: mp.mpf) -> mp.mpf:
    """(acosh(1 + d)/sqrt(2 d) - 1)/d."""
    d = max(d, mp.mpf(10) ** -20)
    return (mp.acosh(1 + d) / mp.sqrt(2 * d) - 1) / d


_QUARTER = mp.pi / 4 * mp.mpf("1.0001")
_HALF_LN2 = mp.log(2) / 2 * mp.mpf("1.001")
_LOG_END = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * mp.mpf("1.001")
_EIGHTH = mp.tan(mp.pi / 8) ** 2 * mp.mpf("1.001")

FITS = {
    "SINE": (_of_square(mp.sin, 1), (0, _QUARTER**2), 6),
    "HALF_TURN": (_of_square(mp.sin, 1), (0, (mp.pi / 2 * mp.mpf("1.001")) ** 2), 8),
    "COSINE": (_cosine, (0, _QUARTER**2), 6),
    "HALF_TANGENT": (_of_square(mp.tan, 1), (0, (_QUARTER / 2) ** 2), 10),
    "EXPONENTIAL": (_exponential, (-_HALF_LN2, _HALF_LN2), 11),
    "LOGARITHM": (_logarithm, (0, _LOG_END), 7),
    "LOGARITHM_REST": (_logarithm_rest, (0, _LOG_END), 8),
    "ARCTANGENT": (_of_square(mp.atan, 1), (0, _EIGHTH), 11),
    "ARCSINE": (_of_square(mp.asin, 1), (0, mp.mpf("0.2501")), 13),
    "SINE_HYPERBOLIC": (_of_square(mp.sinh, 1), (0, 1), 8),
    "ARC_SINE_HYPERBOLIC": (_of_square(mp.asinh, 1), (0, mp.mpf("0.2501")), 13),
    "ARC_COSINE_HYPERBOLIC": (_arc_cosine, (0, mp.mpf("0.5001")), 13),
    "ARC_TANGENT_HYPERBOLIC": (_of_square(mp.atanh, 1), (0, mp.mpf("0.2501")), 15),
    "ERROR_FUNCTION": (_error_function, (0, mp.mpf("0.8101")), 12),
    "ERROR_COMPLEMENT": (_error_complement, (mp.mpf("-0.778"), mp.mpf("0.7501")), 24),
    "RECIPROCAL_CUBE_ROOT": (lambda m: m ** (mp.mpf(-1) / 3), (1, 2), 6),
    "ERF_INV_CENTRAL": (
        lambda t: _erf_inv_central(t + mp.mpf("3.125")),
        (mp.mpf("-3.125"), mp.mpf("3.125")),
        24,
    ),
    "ERF_INV_TAIL": (
        lambda t: _erf_inv_tail(t + mp.mpf("4.25")),
        (mp.mpf("-1.76"), mp.mpf("1.76")),
        30,
    ),
}


def main() -> None:
    for name in sys.argv[1:] or FITS:
        function, interval, count = FITS[name]
        coefficients, error = mp.chebyfit(function, interval, count, error=True)
        print(f"# {name}: error {float(error):.2e} = 2^{float(mp.log(error, 2)):.1f}")
        print(f"{name} = [")
        for coefficient in reversed(coefficients):
            print(f"    {float(coefficient)!r},")
        print("]", flush=True)


if __name__ == "__main__":
    main()
