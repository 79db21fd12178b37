"""Statistics of a sample of cases: fractions and percentiles with their intervals.

SciPy has the distribution functions at the end, too, but its import would take a tenth of a short
study.
"""

import abc
import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.core.errors import ArgumentError
from jaxsat.core.once import latest
from jaxsat.core.text import number_text

LEVEL = 0.95


class Interval(NamedTuple):
    """An estimate with its confidence interval; an unbounded end is infinite."""

    value: float
    low: float
    high: float


def wilson(successes: int, count: int, level: float = LEVEL) -> Interval:
    """Fraction with Wilson's score interval, which is valid also near 0 and 1.

    E. B. Wilson, J. Am. Stat. Assoc. 22, 1927.
    """
    if not 0 <= successes <= count or count < 1:
        raise ValueError(f"Must have 0 <= successes <= count, but got {successes} of {count}.")
    quantile = NormalDist().inv_cdf((1 + level) / 2)
    fraction, weight = successes / count, quantile**2 / count
    centre = (fraction + weight / 2) / (1 + weight)
    half = (
        quantile * np.sqrt(fraction * (1 - fraction) / count + weight / (4 * count)) / (1 + weight)
    )
    return Interval(fraction, max(0.0, float(centre - half)), min(1.0, float(centre + half)))


class AbstractStopRule(abc.ABC):
    """A rule that ends a study, by the number of successes in one sense or more."""

    column: ClassVar[str] = "settling_time"
    """Store column that defines successes: finite times, margins from 0 on."""

    @staticmethod
    def successes(values: np.ndarray) -> Any:
        """Number of successes among these values of `column`."""
        return int(np.isfinite(values).sum())

    @abc.abstractmethod
    def met(self, successes: Any, count: int) -> bool:
        """Whether `count` cases with this number of successes are enough."""


@dataclass(frozen=True)
class StopRule(AbstractStopRule):
    """Stop once the Wilson interval of the settled fraction is at most ±`half_width` wide."""

    half_width: float
    least: int = 100
    level: float = LEVEL

    def __post_init__(self):
        if not 0 < self.half_width < 1:
            raise ArgumentError("half_width", "must be between 0 and 1", self.half_width)

    def met(self, successes: int, count: int) -> bool:
        """Whether the interval is narrow enough."""
        if count < self.least:
            return False
        interval = wilson(successes, count, self.level)
        return (interval.high - interval.low) / 2 <= self.half_width


@dataclass(frozen=True)
class WhenDecided(AbstractStopRule):
    """Stop once the settled fraction is above, or below, `fraction` with confidence.

    The test is valid after any number of cases, and for each of several `candidates`: with a
    probability of at most (1 - level) / 2 any of those with no larger fraction is ever declared
    above, and the same for below. For this the likelihood of the observations, averaged over all
    fractions on the other side, must exceed that under `fraction` by a factor. H. Robbins, Ann.
    Math. Stat. 41, 1970; J. Ville, 1939.
    """

    fraction: float
    candidates: int = 1
    level: float = LEVEL

    def met(self, successes: int, count: int) -> bool:
        """Whether the fraction is above or below, with confidence."""
        below = self._decides(count - successes, count, 1 - self.fraction)
        return below or self.above(successes, count)

    def above(self, successes: int, count: int) -> bool:
        """Whether the fraction is above with confidence."""
        return self._decides(successes, count, self.fraction)

    def interval(self, successes: int, count: int) -> Interval:
        """Fraction, and the bounds of all fractions that are not rejected as too small or too
        large.

        At whatever number of cases a study stops, the true fraction is below the interval with a
        probability of at most (1 - level) / 2, and above it alike, for all `candidates` together.
        """
        low = self._least_likely(successes, count)
        high = 1 - self._least_likely(count - successes, count)
        return Interval(successes / count, low, high)

    def _least_likely(self, successes: int, count: int) -> float:
        """Largest fraction that this number of successes rejects."""
        low, high = 0.0, successes / count
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self._decides(successes, count, middle) else (low, middle)
        return low

    def _decides(self, successes: int, count: int, fraction: float) -> bool:
        """Whether this number of successes rejects true fractions of `fraction` or less."""
        from scipy import special  # takes its time, and a study that is computed has no use for it

        if fraction in (0, 1):
            return fraction == 0 < successes
        shape = (successes + 1, count - successes + 1)
        with np.errstate(divide="ignore"):  # log 0: no larger fraction is likely
            larger = special.betaln(*shape) + np.log(special.betaincc(*shape, fraction))
        alike = special.xlogy(successes, fraction) + special.xlog1py(shape[1], -fraction)
        return bool(larger - alike >= np.log(2 * self.candidates / (1 - self.level)))


@dataclass(frozen=True)
class WhenAllDecided(AbstractStopRule):
    """Stop once `each` has decided every requirement of a study."""

    each: WhenDecided

    column: ClassVar[str] = "requirement_margin"

    @staticmethod
    def successes(values: np.ndarray) -> Any:
        """Number of cases that meet each requirement."""
        return (values >= 0).sum(axis=0)

    def met(self, successes: Any, count: int) -> bool:
        """Whether every requirement is decided."""
        return all(self.each.met(int(one), count) for one in successes)


def percentile(values: np.ndarray, percent: float) -> Interval:
    """Percentile with the interval between two order statistics; values may be infinite, not NaN.

    The number of draws below the percentile is binomial, whatever their distribution, so the
    interval covers the percentile with a probability of at least 0.95, half of the rest on either
    side. If no order statistic has enough confidence, an end is infinite: nothing is known beyond
    the largest value. H. A. David, H. N. Nagaraja, Order Statistics, 3rd edition, 2003, 7.1.
    """
    values = np.sort(np.asarray(values, dtype=float))
    if not len(values) or np.isnan(values).any():
        raise ValueError("Argument `values` must hold at least one value and no NaN.")
    below, above = _order_statistics(len(values), percent)
    low = float(values[below - 1]) if below else -np.inf
    high = float(values[above]) if above < len(values) else np.inf
    return Interval(_of_sorted(values, percent), low, high)


@latest(256)
def _order_statistics(count: int, percent: float) -> tuple[int, int]:
    """Number of order statistics below a percentile, and index of the first above it, each with the
    confidence `LEVEL` of both."""
    first, at_most = binomial(count, percent / 100)
    tail = (1 - LEVEL) / 2
    below = first + int(np.searchsorted(at_most, tail, side="right"))
    return below, min(first + int(np.searchsorted(at_most, 1 - tail)), count)


def _of_sorted(values: np.ndarray, percent: float) -> float:
    """Linear interpolation between order statistics that preserves infinities."""
    place = percent / 100 * (len(values) - 1)
    below = int(np.floor(place))
    low, high = values[below], values[min(below + 1, len(values) - 1)]
    share = place - below
    if share == 0 or low == high:
        return float(low)
    return float(low + share * (high - low)) if np.isfinite(high) else float(high)


def percent_texts(interval: Interval) -> tuple[str, str, str]:
    """A fraction and the ends of its interval, "99.90%", with digits that tell the ends apart."""
    width, digits = 100 * (interval.high - interval.low), 2
    while digits < 6 and 0 < width < 10 ** (1 - digits):
        digits += 1
    value, low, high = (f"{one:.{digits}%}" for one in interval)
    return value, low, high


def fraction_text(interval: Interval) -> str:
    """A fraction with its interval, "99.90% (99.64% to 99.97%)"."""
    value, low, high = percent_texts(interval)
    return f"{value} ({low} to {high})"


def interval_text(interval: Interval, text_of: Callable[[float], str] = number_text) -> str:
    """Return a number with its interval, "1.5 (1 to 2)"; "1.5 (over 1)" for an open upper end.

    It is the number alone where both ends are open, as of a single case.
    """
    value, low, high = map(text_of, interval)
    if np.isfinite(interval.high):
        return (
            f"{value} ({low} to {high})" if np.isfinite(interval.low) else f"{value} (up to {high})"
        )
    return f"{value} (over {low})" if np.isfinite(interval.low) else value


FAR = 12
"""Standard deviations of a binomial number beyond which its probability rounds to zero."""

HALVINGS = 60
"""Bisections of the unit interval for a quantile."""


def binomial(count: int, probability: float) -> tuple[int, Float[np.ndarray, " numbers"]]:
    """First of the numbers of successes near the mode, and the probabilities of at most each.

    Those of all others, more than `FAR` standard deviations away, are not computed. Ratios of
    neighbouring terms give all of them.
    """
    complement = 1 - probability
    mode = min(math.floor((count + 1) * probability), count)
    reach = FAR * math.ceil(1 + math.sqrt(count * probability * complement))
    first = max(mode - reach, 0)
    more, fewer = np.arange(mode, min(mode + reach, count)), np.arange(mode, first, -1)
    above = np.cumprod((count - more) * probability / ((more + 1) * complement))
    below = np.cumprod(fewer * complement / ((count - fewer + 1) * probability))
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
