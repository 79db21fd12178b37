"""Sensitivity of results to dispersed numbers: first-order indices and rank correlations.

Intervals hold for all numbers of a study together: without any influence, one study of forty shows
some.
"""

from collections.abc import Iterable
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from jaxsat.studies.statistics import LEVEL, Interval, f_quantile

UNKNOWN = Interval(float("nan"), float("nan"), float("nan"))

ROUNDING = 1e-12
"""Round-off tolerance on a first-order index of zero, relative to the variance."""


class Sensitivity(NamedTuple):
    """Sensitivity of a result to one dispersed number.

    `rank_correlation` is Spearman's; `first_order` is the share of the result's variance that the
    number explains alone, Sobol's first-order index; NaN without variation.
    """

    name: str
    first_order: Interval
    rank_correlation: Interval

    @property
    def matters(self) -> bool:
        """Whether the interval of the first-order index excludes zero."""
        return self.first_order.low > 0


def numbers_of(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Split the draws of a name, (cases, components), into numbers by their names in reports.

    A quantity of one number may have shape (cases,). Components are numbered from 1. A quaternion,
    whose components are dependent and whose sign is arbitrary, becomes the angle (rad, 0 to π) of
    the rotation and its axis.
    """
    values = np.asarray(values, dtype=float).reshape(len(values), -1)
    if name == "attitude":
        scalar, vector = values[:, 0], values[:, 1:]
        size = np.linalg.norm(vector, axis=1)
        axis = np.where(scalar < 0, -1.0, 1.0) / np.where(size > 0, size, 1.0)
        parts = {"angle": 2 * np.arctan2(size, np.abs(scalar))}
        parts |= {f"axis {i + 1}": vector[:, i] * axis for i in range(3)}
        return {f"{name}[{part}]": column for part, column in parts.items()}
    if values.shape[1] == 1:
        return {name: values[:, 0]}
    return {f"{name}[{i + 1}]": column for i, column in enumerate(values.T)}


class Sensitivities:
    """Sensitivities of one or more results to dispersed numbers, added one name after the other.

    Cases with a non-finite result are left out. The draws must be independent; if they are not, as
    the components of an axis, an index includes the share in common with others. Sorting dominates
    the time: every number and every result is sorted once.
    """

    def __init__(self, results: Iterable[np.ndarray]):
        self._results = [_Result(np.asarray(result, dtype=float)) for result in results]
        self._evidence: list[list[_Evidence]] = [[] for _ in self._results]

    def add(self, name: str, values: np.ndarray) -> None:
        """Add the draws of a name, as `numbers_of` takes them."""
        for label, column in numbers_of(name, values).items():
            order = np.argsort(column, kind="stable")
            for evidence, result in zip(self._evidence, self._results, strict=True):
                cases = order[result.fine[order]]
                evidence.append(_evidence(label, column[cases], result.place[cases], result))

    def ranked(self) -> list[list[Sensitivity]]:
        """All numbers for every result, the largest index first, unknown ones last."""
        return [
            sorted(
                (entry.sensitivity((1 - LEVEL) / len(evidence)) for entry in evidence),
                key=lambda entry: -np.nan_to_num(entry.first_order.value, nan=-2.0),
            )
            for evidence in self._evidence
        ]


class _Result:
    """Finite values of a result, their places among these, and their ranks less the mean rank."""

    def __init__(self, values: np.ndarray):
        self.fine = np.isfinite(values)
        self.place = np.cumsum(self.fine) - 1
        self.values = values[self.fine]
        order = np.argsort(self.values, kind="stable")
        self.ranks = np.empty(len(order))
        self.ranks[order] = _ranks(self.values[order])


class _Index(NamedTuple):
    """A first-order index, the standard deviation of its estimate, and groups of the cases."""

    value: float
    deviation: float
    groups: int
    cases: int


class _Evidence(NamedTuple):
    """Estimates for one number, before the number of simultaneous intervals is known."""

    name: str
    share: _Index | None
    correlation: float
    cases: int

    def sensitivity(self, tails: float) -> Sensitivity:
        """Sensitivity, with intervals that miss with a probability of `tails`."""
        index = UNKNOWN if self.share is None else _index_interval(self.share, tails)
        return Sensitivity(
            self.name, index, _correlation_interval(self.correlation, self.cases, tails)
        )


def _evidence(name: str, x: np.ndarray, places: np.ndarray, result: _Result) -> _Evidence:
    """Evidence of ascending numbers `x` and their places in a result."""
    y = result.values[places]
    if not len(x) or not x[-1] > x[0] or not np.ptp(y) > 0:  # NaN is last
        return _Evidence(name, None, float("nan"), len(x))
    correlation = _correlation(_ranks(x), result.ranks[places])
    return _Evidence(name, _first_order_index(y), correlation, len(x))


def _ranks(ascending: np.ndarray) -> np.ndarray:
    """Ranks less their mean; equal numbers share their mean rank."""
    new = np.flatnonzero(np.diff(ascending, prepend=np.nan) != 0)
    counts = np.diff(new, append=len(ascending))
    return np.repeat(new + (counts - len(ascending)) / 2, counts)


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Correlation of zero-mean numbers; NaN for fewer than three."""
    if len(x) < 3:
        return float("nan")
    return float(np.sum(x * y) / np.sqrt(np.sum(x**2) * np.sum(y**2)))


def _correlation_interval(r: float, cases: int, tails: float) -> Interval:
    """Interval by Fisher's transformation: Bonett and Wright, Psychometrika 65, 2000."""
    if np.isnan(r):
        return UNKNOWN
    if cases < 4:
        return Interval(r, -1.0, 1.0)
    half = NormalDist().inv_cdf(1 - tails / 2) * np.sqrt((1 + r**2 / 2) / (cases - 3))
    middle = np.arctanh(np.clip(r, -1 + 1e-15, 1 - 1e-15))
    return Interval(r, float(np.tanh(middle - half)), float(np.tanh(middle + half)))


def _first_order_index(y: np.ndarray) -> _Index | None:
    """Var(E[y | x]) / Var(y) of results in the order of the numbers x, None if it is unknown.

    From bins of equal counts of x, less the expectation by chance. E. Plischke, Reliability
    Engineering & System Safety 95, 2010, has the estimator; the correction is that of the analysis
    of variance (ω²), without which many bins look like sensitivity. Variation of y within a bin is
    unresolved: if y oscillates with x and the cases are few, the index is too small. The deviation
    is that of 2 m (y - μ) - m² - S (y - μ)², over Var(y), with m the mean of a bin less μ: the
    influence of one more case.
    """
    count = len(y)
    bins = max(2, min(32, round(count**0.4)))
    if count < 2 * bins or not np.var(y) > 0:
        return None
    sizes = np.full(bins, count // bins)
    sizes[: count % bins] += 1
    begins = np.cumsum(sizes) - sizes
    off = y - np.mean(y)
    means = np.add.reduceat(off, begins) / sizes
    m = np.repeat(means, sizes)
    between, within = float(np.sum(m**2)), float(np.sum((off - m) ** 2))
    noise, total = within / (count - bins), between + within
    influence = (2 * m * off - m**2 - between / total * off**2) / (total / count)
    explained = between - (bins - 1) * noise
    value = explained / (total + noise) if abs(explained) > ROUNDING * total else 0.0
    return _Index(value, float(np.sqrt(np.mean(influence**2) / count)), bins, count)


def _index_interval(index: _Index, tails: float) -> Interval:
    """Score interval of an index, from two errors added in squares.

    The first is the chance value of an index of zero, by the quantiles of F of the analysis of
    variance, so that the lower end is above zero if the F test rejects; the second the deviation of
    the estimate, whose square grows in proportion to the index. It is asymptotic: an index far from
    zero of a result with a heavy tail is less certain.
    """
    between, within = index.groups - 1, index.cases - index.groups

    def by_chance(quantile: float) -> float:
        f = f_quantile(between, within, quantile)
        return between * (f - 1) / (between * f + within + 1)

    weight = NormalDist().inv_cdf(1 - tails / 2) ** 2
    slope = weight * index.deviation**2 / index.value if index.value > 0 else 0.0
    constant = slope * max(index.value, 0.0)
    down = by_chance(1 - tails / 2) ** 2 + constant
    up = by_chance(tails / 2) ** 2 + constant
    low = index.value - 2 * down / (np.sqrt(slope**2 + 4 * down) + slope)  # no cancellation
    high = index.value + (np.sqrt(slope**2 + 4 * up) + slope) / 2
    return Interval(index.value, *np.clip([low, high], 0.0, 1.0).tolist())
