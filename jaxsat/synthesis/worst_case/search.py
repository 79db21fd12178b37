"""Search for the least margin among the likely cases, beside as many random cases.

The cases lie in a space of independent standard normal numbers. The likely ones are those in the
ball about its origin that has a given probability.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from jaxsat.studies.splitting import Evaluate, cube_points
from jaxsat.synthesis.tuning.strategies import new_strategy

PORTION = 5
"""One flight of so many of a search is a random one, and so a possible start."""

DEVIATION, CONVERGED = 1.0, 1e-4
"""Standard deviation of a first generation about its start, and of one after which a search begins
at the next start."""

BATCH = 512
"""Largest number of random flights together."""


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


def search(evaluate: Evaluate, ball: Ball, flights: int, seed: int) -> int:
    """Evaluate random cases, then as many on a search; return how many the two have in common.

    The order is: `flights` random cases, of which the first ones belong to the search too, and the
    others of the search. Covariance matrix adaptation begins at the worst of the common cases,
    whose noise it keeps, and again at the next one when it has converged.
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
    left = flights - common
    for turn, start in enumerate(np.argsort(margins[:common], kind="stable")):
        if left > 0:
            left -= _adapt(evaluate, ball, x[start], int(noise[start]), (seed + turn) % 2**31, left)
    return common


def _adapt(
    evaluate: Evaluate, ball: Ball, start: np.ndarray, noise: int, seed: int, most: int
) -> int:
    """Evaluate generations about a start until they converge; return the number of cases."""
    strategy = new_strategy(start, seed, bounds=(-np.inf, np.inf), deviation=DEVIATION)
    done = 0
    while done < most and strategy.result.stds.max() > CONVERGED:
        y = np.array(strategy.ask())[: most - done]
        margins = evaluate(cube_points(ball.reflected(y)), np.full(len(y), noise, np.uint32))
        done += len(y)
        if done < most:
            ranks = np.argsort(np.argsort(margins, kind="stable"))  # margins may be infinite
            strategy.tell(list(y), ranks.astype(float).tolist())
    return done
