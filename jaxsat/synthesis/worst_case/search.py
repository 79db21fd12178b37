"""Search for the least margin in the ball of the likely cases, beside as many random cases.

The ball is in the space of independent standard normal numbers. A gradient consists of differences
over steps so small that the margin is linear there if it has a derivative. Differences need no
derivative of the program, and a flight in machine code takes less time than one of the tangents of
forward mode, of which there is one for each number as well.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import chdtri

from jaxsat.studies.splitting import Evaluate, cube_points
from jaxsat.synthesis.tuning.strategies import new_strategy


class Ball(NamedTuple):
    """The ball of this `dimension` and `radius`, in standard deviations."""

    dimension: int
    radius: float

    @staticmethod
    def with_probability(dimension: int, probability: float) -> "Ball":
        """Return the ball that holds this part of all cases."""
        return Ball(dimension, float(np.sqrt(chdtri(dimension, 1 - probability))))

    def draws(self, generator: np.random.Generator, count: int) -> Float[np.ndarray, "count d"]:
        """Draw normal numbers in the ball, each again until it is inside."""
        x = generator.standard_normal((count, self.dimension))
        while (outside := np.linalg.norm(x, axis=1) > self.radius).any():
            x[outside] = generator.standard_normal((int(outside.sum()), self.dimension))
        return x

    def reflected(self, y: Float[np.ndarray, "n d"]) -> Float[np.ndarray, "n d"]:
        """Return points as they are inside the ball, and reflected at its surface outside.

        The image of the whole space is the ball, and its surface no end of it: a strategy without
        bounds can surround a minimum there.
        """
        length = np.linalg.norm(y, axis=1, keepdims=True)
        folded = self.radius - np.abs(np.mod(length, 2 * self.radius) - self.radius)
        return y * (folded / np.where(length > 0, length, 1.0))

    def least_along(
        self, gradient: Float[np.ndarray, " d"], offset: Float[np.ndarray, " d"]
    ) -> Float[np.ndarray, " d"]:
        """Return the point where a function of this gradient, if it were linear, is least.

        `offset` has the coordinates that stay, which have no gradient, and zeros for others.
        """
        half_chord = np.sqrt(max(self.radius**2 - offset @ offset, 0.0))
        return offset - half_chord * gradient / np.linalg.norm(gradient)


STEP = 1e-4
"""Step of differences, in standard deviations."""

AGREEMENT = 0.1
"""Largest relative difference of the slope along a gradient, by a central difference, from the
length of a gradient that can be trusted."""

FRACTIONS = 0.5 ** np.arange(10)
"""Tried steps, as parts of the way to where the margin would be least if it were linear."""

LEAST_GAIN = 1e-4
"""Relative gain of a step below which a descent ends."""


class Flown(NamedTuple):
    """A case that was flown: its normal numbers, the number of its noise, and its margin."""

    x: Float[np.ndarray, " d"]
    noise: int
    margin: float


class Descent(NamedTuple):
    """The case at the `end` of a descent, the number of all `flights`, and that of gradients, of
    which so many were `trusted`."""

    end: Flown
    flights: int
    gradients: int
    trusted: int


def descend(
    evaluate: Evaluate, ball: Ball, whole: Bool[np.ndarray, " d"], start: Flown, most: int
) -> Descent:
    """Descend from a case with the same noise, by at most so many flights.

    Coordinates of which the meaning jumps, `whole`, stay. A descent ends where a gradient cannot be
    trusted, or where no step along it gains. It stays so far inside the ball that differences do.
    """
    inner = ball._replace(radius=ball.radius - 2 * STEP)
    if np.linalg.norm(start.x) > inner.radius + STEP:
        most = 0
    moves = np.flatnonzero(~whole)
    offsets = STEP * np.eye(ball.dimension)[moves]
    each = len(moves) + len(FRACTIONS) + 2
    now, flights, gradients, trusted = start, 0, 0, 0
    while flights + each <= most and len(moves) and np.isfinite(now.margin):
        ahead = _margins(evaluate, now.x + offsets, now.noise)
        flights += len(ahead)
        gradient = np.zeros(ball.dimension)
        gradient[moves] = (ahead - now.margin) / STEP
        gradients += 1
        slope = float(np.linalg.norm(gradient))
        if not np.isfinite(slope) or slope == 0:
            break
        along = STEP * gradient / slope
        way = inner.least_along(gradient, np.where(whole, now.x, 0.0)) - now.x
        x = np.stack([now.x + along, now.x - along, *(now.x + FRACTIONS[:, None] * way)])
        margins = _margins(evaluate, x, now.noise)
        flights += len(margins)
        with np.errstate(invalid="ignore"):  # of two infinite margins
            central = (margins[0] - margins[1]) / (2 * STEP)
        agrees = bool(abs(central - slope) <= AGREEMENT * slope)
        trusted += agrees
        least = 2 + int(np.argmin(margins[2:]))
        gain = now.margin - margins[least]
        if gain > 0:
            now = Flown(x[least], now.noise, float(margins[least]))
        if not agrees or gain <= LEAST_GAIN * abs(now.margin):
            break
    return Descent(now, flights, gradients, trusted)


def _margins(evaluate: Evaluate, x: np.ndarray, noise: int) -> Float[np.ndarray, " n"]:
    return evaluate(cube_points(x), np.full(len(x), noise, np.uint32))


PORTION = 5
"""One flight of so many of a search is a random one, and so a possible start."""

DESCENTS = 4
"""Number of descents, which together have at most half of the flights of a search."""

DEVIATION, CONVERGED = 1.0, 1e-4
"""Standard deviation of a first generation about its start, and of one after which a search begins
at the next start."""

BATCH = 512
"""Largest number of random flights together."""


class Searched(NamedTuple):
    """How many flights the search has in `common` with the random cases, the number of
    `gradients`, and how many of them were `trusted`."""

    common: int
    gradients: int
    trusted: int


def search(
    evaluate: Evaluate, ball: Ball, whole: Bool[np.ndarray, " d"], flights: int, seed: int
) -> Searched:
    """Evaluate random cases, then as many on a search.

    The order is: `flights` random cases, of which the first ones belong to the search too, and the
    others of the search. Descents begin at the worst of the common cases, whose noise they keep;
    coordinates of which the meaning jumps, `whole`, stay there. Covariance matrix adaptation begins
    at the least of what they found, and again at the next common case when it has converged.
    """
    generator = np.random.Generator(np.random.Philox(seed))
    x = ball.draws(generator, flights)
    noise = generator.integers(0, 2**32, flights, dtype=np.uint32)
    points = cube_points(x)
    margins = np.concatenate(
        [
            evaluate(points[at : at + BATCH], noise[at : at + BATCH])
            for at in range(0, flights, BATCH)
        ]
    )
    common = max(1, flights // PORTION)
    budget = flights - common
    order = np.argsort(margins[:common], kind="stable")
    starts = [Flown(x[place], int(noise[place]), float(margins[place])) for place in order]
    most = budget // 2 // DESCENTS
    descents = [descend(evaluate, ball, whole, one, most) for one in starts[:DESCENTS]]
    budget -= sum(one.flights for one in descents)
    least = int(np.argmin([one.end.margin for one in descents]))
    others = starts[:least] + starts[least + 1 :]
    for turn, start in enumerate([descents[least].end, *others]):
        if budget > 0:
            budget -= _adapt(evaluate, ball, start, (seed + turn) % 2**31, budget)
    gradients, trusted = (
        sum(counts) for counts in zip(*(one[2:] for one in descents), strict=True)
    )
    return Searched(common, gradients, trusted)


def _adapt(evaluate: Evaluate, ball: Ball, start: Flown, seed: int, most: int) -> int:
    """Evaluate generations about a start until they converge; return the number of cases."""
    strategy = new_strategy(start.x, seed, bounds=(-np.inf, np.inf), deviation=DEVIATION)
    count = 0
    while count < most and strategy.result.stds.max() > CONVERGED:
        y = np.array(strategy.ask())[: most - count]
        margins = evaluate(cube_points(ball.reflected(y)), np.full(len(y), start.noise, np.uint32))
        count += len(y)
        if count < most:
            ranks = np.argsort(np.argsort(margins, kind="stable"))  # margins may be infinite
            strategy.tell(list(y), ranks.astype(float).tolist())
    return count
