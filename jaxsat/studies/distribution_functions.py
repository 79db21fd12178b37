"""Distribution functions of counts and of ratios of variances, for the intervals of a study.

SciPy has them too, but its import would take a tenth of a short study.
"""

import math

import numpy as np
from jaxtyping import Float

from jaxsat.core.once import latest

FAR = 12
"""Standard deviations of a binomial number beyond which its probability rounds to zero."""

HALVINGS = 60
"""Bisections of the unit interval for a quantile."""


def binomial(count: int, probability: float) -> tuple[int, Float[np.ndarray, " numbers"]]:
    """First of the numbers of successes near the mode, and the probabilities of at most each.

    Those of all others, more than `FAR` standard deviations away, are not computed. Ratios of
    neighbouring terms give all of them.
    """
    missed = 1 - probability
    mode = min(math.floor((count + 1) * probability), count)
    reach = FAR * math.ceil(1 + math.sqrt(count * probability * missed))
    first = max(mode - reach, 0)
    more, fewer = np.arange(mode, min(mode + reach, count)), np.arange(mode, first, -1)
    above = np.cumprod((count - more) * probability / ((more + 1) * missed))
    below = np.cumprod(fewer * missed / ((count - fewer + 1) * probability))
    at_most = np.cumsum(np.concatenate([below[::-1], [1.0], above]))
    return first, at_most / at_most[-1]


@latest(256)
def f_quantile(between: int, within: int, probability: float) -> float:
    """Quantile of the ratio F of two estimates of a variance, with these degrees of freedom."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if incomplete_beta(between / 2, within / 2, middle) < probability:
            low = middle
        else:
            high = middle
    return within * low / (between * (1 - low))


def incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function I_x(a, b), for x between 0 and 1.

    NIST Digital Library of Mathematical Functions, (8.17.22) and (8.17.4), by Lentz's method.
    """
    if x > (a + 1) / (a + b + 2):  # the other fraction converges faster
        return 1 - incomplete_beta(b, a, 1 - x)
    scale = math.lgamma(a + b) - math.lgamma(a + 1) - math.lgamma(b)
    c, d = 1.0, 1 / (1 - (a + b) * x / (a + 1))
    fraction, change, m = d, 0.0, 1
    while abs(change - 1) > np.finfo(float).eps:
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        change = 1.0
        for term in (even, odd):
            c, d = 1 + term / c, 1 / (1 + term * d)
            change *= c * d
        fraction, m = fraction * change, m + 1
    return math.exp(scale + a * math.log(x) + b * math.log1p(-x)) * fraction
