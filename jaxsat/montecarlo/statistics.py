"""What a sample of cases says: intervals, percentiles, and which dispersion matters."""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

LEVEL = 0.95


class Interval(NamedTuple):
    """An estimate with its confidence interval."""

    value: float
    low: float
    high: float


def wilson(successes: int, count: int, level: float = LEVEL) -> Interval:
    """A fraction with Wilson's score interval, which holds near 0 and 1 as well.

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


@dataclass(frozen=True)
class StopRule:
    """Stop once the Wilson interval of the settled fraction is at most ±`half_width` wide."""

    half_width: float
    least: int = 100
    level: float = LEVEL

    def __post_init__(self):
        if not 0 < self.half_width < 1:
            raise ValueError(
                f"Argument `half_width` must be between 0 and 1, but got {self.half_width}."
            )

    def met(self, settled: int, count: int) -> bool:
        """Whether so many cases are enough."""
        if count < self.least:
            return False
        found = wilson(settled, count, self.level)
        return (found.high - found.low) / 2 <= self.half_width


def percentile(
    values: np.ndarray, percent: float, *, resamples: int = 500, seed: int = 0, level: float = LEVEL
) -> Interval:
    """A percentile with its bootstrap percentile interval; values may be infinite, not NaN.

    The resamples are not drawn. The order statistics that a resample's percentile lies between
    are those of as many uniform draws, whose joint distribution is known, so that a resample of
    any size costs two numbers.
    """
    values = np.sort(np.asarray(values, dtype=float))
    if not len(values) or np.isnan(values).any():
        raise ValueError("Argument `values` must hold at least one value and no NaN.")
    count = len(values)
    below, share = _place(count, percent)
    generator = np.random.default_rng(seed)
    first = generator.beta(below + 1, count - below, resamples)
    above = max(1, count - below - 1)  # uniform draws beyond the first, the least of which is next
    second = 1 - (1 - first) * generator.random(resamples) ** (1 / above)
    places = [np.minimum((u * count).astype(int), count - 1) for u in (first, second)]
    found = np.sort(_between(values[places[0]], values[places[1]], share))
    tails = 100 * (1 - level) / 2
    low, high = (_of_sorted(found, tail) for tail in (tails, 100 - tails))
    return Interval(_of_sorted(values, percent), low, high)


def _place(count: int, percent: float) -> tuple[int, float]:
    """The order statistic below a percentile, from 0 on, and how far above it the percentile is."""
    place = percent / 100 * (count - 1)
    below = int(np.floor(place))
    return below, place - below


def _of_sorted(values: np.ndarray, percent: float) -> float:
    """Linear interpolation between order statistics."""
    below, share = _place(len(values), percent)
    above = min(below + 1, len(values) - 1)
    return float(_between(values[below], values[above], share))


def _between(low, high, share: float):
    """Linear interpolation that leaves infinities what they are."""
    if share == 0:
        return low
    with np.errstate(invalid="ignore"):
        inside = low + share * (high - low)
    return np.where(np.isfinite(high), inside, high)


class Sensitivity(NamedTuple):
    """How much one dispersed number tells of a result.

    `rank_correlation` is Spearman's; `first_order` is the share of the result's variance that the
    number explains alone, Sobol's first-order index, NaN where nothing varies.
    """

    name: str
    rank_correlation: float
    first_order: float


def sensitivity(drawn: dict[str, np.ndarray], result: np.ndarray) -> list[Sensitivity]:
    """Every dispersed number ranked by its first-order index, from the sample that there is.

    `drawn` has arrays (cases, components); components are numbered from 1. Cases whose result is
    not finite are left out. The draws must be independent of one another.
    """
    measure = Sensitivities([result])
    for name, values in drawn.items():
        measure.add(name, values)
    return measure.ranked()[0]


class Sensitivities:
    """The same of several results at once, the dispersed numbers told one name after the other.

    Sorting is what takes long: every number and every result is sorted once.
    """

    def __init__(self, results: Iterable[np.ndarray]):
        self._results = [_Result(np.asarray(result, dtype=float)) for result in results]
        self._found: list[list[Sensitivity]] = [[] for _ in self._results]

    def add(self, name: str, values: np.ndarray) -> None:
        """What was drawn under a name, (cases, components)."""
        for i, column in enumerate(np.asarray(values, dtype=float).T):
            label = name if values.shape[1] == 1 else f"{name}[{i + 1}]"
            order = np.argsort(column, kind="stable")
            for found, result in zip(self._found, self._results, strict=True):
                kept = order[result.fine[order]]
                x, places = column[kept], result.place[kept]
                found.append(Sensitivity(label, *_of_ordered(x, places, result)))

    def ranked(self) -> list[list[Sensitivity]]:
        """For every result all numbers, ranked."""
        return [ranked(found) for found in self._found]


class _Result:
    """A result's finite values, their places among these, and their ranks less the mean rank."""

    def __init__(self, values: np.ndarray):
        self.fine = np.isfinite(values)
        self.place = np.cumsum(self.fine) - 1
        self.values = values[self.fine]
        order = np.argsort(self.values, kind="stable")
        self.ranks = np.empty(len(order))
        self.ranks[order] = _ranks(self.values[order])


def _of_ordered(x: np.ndarray, places: np.ndarray, result: _Result) -> tuple[float, float]:
    """Rank correlation and first-order index of a result by ascending numbers and its places."""
    y = result.values[places]
    if not len(x) or not x[-1] > x[0] or not np.ptp(y) > 0:  # NaN comes last
        return float("nan"), float("nan")
    return _correlation(_ranks(x), result.ranks[places]), _explained(y, None)


def _ranks(ascending: np.ndarray) -> np.ndarray:
    """Ranks less their mean; equal numbers share the mean of theirs."""
    new = np.flatnonzero(np.diff(ascending, prepend=np.nan) != 0)
    counts = np.diff(new, append=len(ascending))
    return np.repeat(new + (counts - len(ascending)) / 2, counts)


def _correlation(x: np.ndarray, y: np.ndarray) -> float:
    """Of numbers without mean; NaN for fewer than three."""
    if len(x) < 3:
        return float("nan")
    return float(np.sum(x * y) / np.sqrt(np.sum(x**2) * np.sum(y**2)))


def ranked(found: Iterable[Sensitivity]) -> list[Sensitivity]:
    """The largest first-order index first, those that are not known last."""
    return sorted(found, key=lambda entry: -np.nan_to_num(entry.first_order, nan=-1.0))


def first_order_index(x: np.ndarray, y: np.ndarray, bins: int | None = None) -> float:
    """Var(E[y | x]) / Var(y) from bins of equal counts of x, less what chance alone gives.

    E. Plischke, Reliability Engineering & System Safety 95, 2010, has the estimator; the
    correction is that of the analysis of variance (ω²), without which many bins look like
    sensitivity.
    """
    if not np.ptp(x) > 0:
        return float("nan")
    return _explained(np.asarray(y, dtype=float)[np.argsort(x, kind="stable")], bins)


def _explained(y: np.ndarray, bins: int | None) -> float:
    """`first_order_index` of results in the order of the numbers."""
    count = len(y)
    bins = max(2, min(32, round(count ** (1 / 3)))) if bins is None else bins
    if count < 2 * bins or not np.var(y) > 0:
        return float("nan")
    groups = np.array_split(y, bins)
    mean = np.mean(y)
    between = sum(len(group) * (group.mean() - mean) ** 2 for group in groups)
    within = sum(((group - group.mean()) ** 2).sum() for group in groups)
    noise = within / (count - bins)
    return float((between - (bins - 1) * noise) / (between + within + noise))
