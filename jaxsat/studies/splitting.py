"""The probability of a rare event, by multilevel splitting.

The cases lie in a space of independent standard normal numbers, and an event is a margin below
zero. Margins below levels that decrease to zero are nested events, none of which is rare given the
previous one. A pilot run sets the levels; it is subset simulation of S.-K. Au and J. L. Beck,
Probabilistic Engineering Mechanics 16, 2001, with the Markov chains of I. Papaioannou, W. Betz, K.
Zwirglmaier, D. Straub, ibid. 41, 2015. Replications then keep levels and steps fixed and sample the
seeds of their chains without bias, so that the mean of their estimates is the probability: P. Del
Moral, Feynman-Kac Formulae, 2004, theorem 7.4.2.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt32
from scipy.special import ndtr, stdtrit

from jaxsat.core.errors import ArgumentError
from jaxsat.studies.statistics import Interval

LENGTH = 10
"""Cases of a chain, seed included; its inverse is the fraction of cases below the next level."""

ACCEPTED = 0.44
"""Target acceptance rate of the moves (Papaioannou et al.)."""

FIRST_SIZE = 0.6
"""Size of the first moves: 0 for none, 1 for an independent draw."""

MORE = 0.3
"""Probability of a redraw of each further part that is redrawn whole; one part always is."""

Evaluate = Callable[
    [Float[np.ndarray, "cases dimension"], UInt32[np.ndarray, " cases"]],
    Float[np.ndarray, " cases"],
]
"""Function from points in the open unit cube and noise numbers to the margins of cases."""


def cube_points(x: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the points of the open unit cube at standard normal numbers."""
    return np.clip(ndtr(x), 2.0**-53, 1 - 2.0**-53)


class Space(NamedTuple):
    """Mask of `whole` coordinates, which are redrawn, not moved, as their meaning jumps; and
    whether cases have noise, which is always redrawn whole."""

    whole: Bool[np.ndarray, " dimension"]
    noisy: bool

    @property
    def moves(self) -> bool:
        """Whether there is a coordinate that moves."""
        return not self.whole.all()

    @property
    def redraws(self) -> int:
        """Number of parts that are redrawn whole."""
        return int(self.whole.sum()) + self.noisy


class Population(NamedTuple):
    """Cases: normal numbers `x`, `noise`, `margin`, the `number` of the evaluation, and the `root`,
    the number of the independent draw from which the case descends."""

    x: Float[np.ndarray, "*n dimension"]
    noise: UInt32[np.ndarray, "*n"]
    margin: Float[np.ndarray, "*n"]
    number: Int[np.ndarray, "*n"]
    root: Int[np.ndarray, "*n"]

    def at(self, places: np.ndarray | tuple) -> "Population":
        """Return the cases at these places."""
        return Population(*(one[places] for one in self))

    def split(self, rows: int) -> "Population":
        """Return the cases in this number of rows."""
        return Population(*(one.reshape(rows, -1, *one.shape[1:]) for one in self))

    def joined(self) -> "Population":
        """Return the cases of all rows in one."""
        return Population(*(one.reshape(-1, *one.shape[2:]) for one in self))


class Level(NamedTuple):
    """Largest `margin` of the cases of the next population, and the `size` of its moves.

    `moved` and `redrawn` are the acceptance rates of moves and of whole redraws, NaN without any.
    """

    margin: float
    size: float
    moved: float
    redrawn: float


class Replications(NamedTuple):
    """Independent estimates of the probability.

    `fractions` (replications, levels + 1) are at or below each level given the one before, at last
    below zero. `last` has the populations (alive, cases) below the last level, of the replications
    that are still `alive` there. `levels` hold the acceptance rates, and `draws` the numbers of all
    independent draws.
    """

    fractions: Float[np.ndarray, "replications levels"]
    last: Population
    alive: Int[np.ndarray, " alive"]
    levels: list[Level]
    draws: Int[np.ndarray, " draws"]

    @property
    def probabilities(self) -> Float[np.ndarray, " replications"]:
        """Estimate of each replication."""
        return self.fractions.prod(axis=1)

    @property
    def of_last(self) -> Float[np.ndarray, " replications"]:
        """Estimate by each replication of the probability of margins below the last level."""
        return self.fractions[:, :-1].prod(axis=1)


class Splitting:
    """Estimator of the probability of a margin below zero, from `cases` per population.

    Raises `ArgumentError` for a number of cases that chains do not divide.
    """

    def __init__(self, space: Space, evaluate: Evaluate, cases: int, seed: int):
        if cases < LENGTH or cases % LENGTH:
            raise ArgumentError("cases", f"must be a multiple of {LENGTH}", cases)
        self._space, self._evaluate, self._cases = space, evaluate, cases
        self._generator = np.random.Generator(np.random.Philox(seed))
        self._evaluated = 0

    def pilot(self, least: float) -> tuple[list[Level], bool]:
        """Return the levels, and whether the last population reaches the event.

        It does not if the margin stops decreasing, or if its probability is below `least`, with
        confidence.
        """
        population, size = self._draws(self._cases), FIRST_SIZE
        levels: list[Level] = []
        probability = 1.0
        while (population.margin < 0).mean() < 1 / LENGTH:
            margin = self._next_margin(population.margin, levels)
            if margin is None or probability < least:
                return levels, bool((population.margin < 0).any())
            below = population.margin <= margin
            probability *= below.mean()
            begins = population.at(self._chosen(below))
            population, level = self._chains(begins, margin, size, adapt=True)
            levels.append(level)
            size = level.size
        return levels, True

    def replicate(self, levels: list[Level], replications: int) -> Replications:
        """Return independent estimates with these levels."""
        population = self._draws(replications * self._cases)
        draws, rows = population.number, population.split(replications)
        fractions = np.zeros((replications, len(levels) + 1))
        alive, outcomes = np.arange(replications), []
        for place, level in enumerate(levels):
            below = rows.margin <= level.margin
            fractions[alive, place] = below.mean(axis=1)
            lives = np.flatnonzero(below.any(axis=1))
            rows, alive, below = rows.at(lives), alive[lives], below[lives]
            if not len(alive):
                break
            chosen = np.stack([self._chosen(row) for row in below])
            begins = rows.at((np.arange(len(alive))[:, None], chosen)).joined()
            population, outcome = self._chains(begins, level.margin, level.size, adapt=False)
            outcomes.append(outcome)
            rows = _by_replication(population, len(alive))
        fractions[alive, -1] = (rows.margin < 0).mean(axis=1)
        return Replications(fractions, rows, alive, outcomes, draws)

    def _draws(self, count: int) -> Population:
        x = self._generator.standard_normal((count, len(self._space.whole)))
        return self._evaluated_at(x, self._noise(count), None)

    def _noise(self, count: int) -> UInt32[np.ndarray, " count"]:
        return self._generator.integers(0, 2**32, count, dtype=np.uint32)

    def _evaluated_at(self, x, noise, root: np.ndarray | None) -> Population:
        """Evaluate cases; they are their own roots if none are given."""
        points = cube_points(x)
        number = self._evaluated + np.arange(len(x))
        self._evaluated += len(x)
        margin = self._evaluate(points, noise)
        return Population(x, noise, margin, number, number if root is None else root)

    def _next_margin(self, margins: np.ndarray, levels: list[Level]) -> float | None:
        """Margin quantile of one in `LENGTH`; among ties the next lower margin. None if no margin
        from zero on remains."""
        last = levels[-1].margin if levels else np.inf
        lower = margins[(margins < last) & (margins >= 0)]
        if not len(lower):
            return None
        place = self._cases // LENGTH - 1
        return float(min(np.partition(margins, place)[place], lower.max()))

    def _chosen(self, below: Bool[np.ndarray, " cases"]) -> Int[np.ndarray, " begins"]:
        """Places of the seeds of chains: each case below the level has the same expected count.

        Systematic resampling: J. Carpenter, P. Clifford, P. Fearnhead, IEE Proceedings - Radar,
        Sonar and Navigation 146, 1999.
        """
        places = self._generator.permutation(np.flatnonzero(below))
        begins = self._cases // LENGTH
        at = (np.arange(begins) + self._generator.random()) * (len(places) / begins)
        return places[np.minimum(at.astype(int), len(places) - 1)]

    def _chains(
        self, now: Population, margin: float, size: float, *, adapt: bool
    ) -> tuple[Population, Level]:
        """All cases of the chains that start at `now` and stay at or below a margin, step by step
        in sequence, and the acceptance rates."""
        cases, moved, redrawn = [now], [], []
        for step in range(1, LENGTH):
            moving = self._moving(len(now.margin))
            proposed = self._proposed(now, moving, size)
            accepted = proposed.margin <= margin
            now = Population(
                *(
                    np.where(accepted.reshape(-1, *[1] * (new.ndim - 1)), new, old)
                    for new, old in zip(proposed, now, strict=True)
                )
            )
            cases.append(now)
            moved.append(accepted[moving])
            redrawn.append(accepted[~moving])
            if adapt and moving.any():
                size = min(1.0, size * np.exp((moved[-1].mean() - ACCEPTED) / np.sqrt(step)))
        rates = (_mean(np.concatenate(one)) for one in (moved, redrawn))
        together = Population(*(np.concatenate(one) for one in zip(*cases, strict=True)))
        return together, Level(margin, float(size), *rates)

    def _moving(self, count: int) -> Bool[np.ndarray, " count"]:
        """Mask of the chains that move; the others redraw some parts whole."""
        if not (self._space.moves and self._space.redraws):
            return np.full(count, self._space.moves or not self._space.redraws)
        return self._generator.random(count) < 0.5

    def _proposed(self, now: Population, moving: np.ndarray, size: float) -> Population:
        """Proposal for each chain, which preserves the distribution of draws."""
        generator, whole = self._generator, self._space.whole
        fresh = generator.standard_normal(now.x.shape)
        move = moving[:, None] & ~whole
        x = np.where(move, np.sqrt(1 - size**2) * now.x + size * fresh, now.x)
        again = self._again(~moving)
        x[:, whole] = np.where(again[:, : whole.sum()], fresh[:, whole], x[:, whole])
        noise = now.noise
        if self._space.noisy:
            noise = np.where(again[:, -1], self._noise(len(noise)), noise)
        return self._evaluated_at(x, noise, now.root)

    def _again(self, redrawing: np.ndarray) -> Bool[np.ndarray, "chains redraws"]:
        """Mask of the parts redrawn whole: at least one part of each of these chains."""
        parts = self._space.redraws
        if not parts:
            return np.zeros((len(redrawing), 0), bool)
        again = self._generator.random((len(redrawing), parts)) < MORE
        again[np.arange(len(again)), self._generator.integers(parts, size=len(again))] = True
        return again & redrawing[:, None]


def interval_of(estimates: Float[np.ndarray, " replications"], level: float) -> Interval:
    """Mean of independent estimates of a probability, and its interval.

    The estimates are skewed and nearly log-normal (F. Cérou, A. Guyader, Stoch. Anal. Appl. 25,
    2007). So the logarithm of the mean has the interval of D. R. Cox for that of a log-normal mean
    (X.-H. Zhou, S. Gao, Statistics in Medicine 16, 1997), with Student's distribution. If an
    estimate is zero, the variance of the logarithms follows from that of the estimates.
    """
    count, mean = len(estimates), float(estimates.mean())
    if mean == 0:
        return Interval(0.0, 0.0, np.inf)
    if estimates.all():
        variance = np.log(estimates).var(ddof=1)
    else:
        variance = np.log1p(estimates.var(ddof=1) / mean**2)
    error = np.sqrt(variance / count + variance**2 / (2 * (count - 1)))
    factor = float(np.exp(stdtrit(count - 1, (1 + level) / 2) * error))
    return Interval(mean, mean / factor, min(1.0, mean * factor))


def _by_replication(population: Population, count: int) -> Population:
    """Cases of chains of all replications (steps, replications, begins), by replication."""
    steps = population.split(LENGTH * count)
    order = np.arange(LENGTH * count).reshape(LENGTH, count).T.ravel()
    return steps.at(order).joined().split(count)


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else float("nan")
