"""Search for the least margin in the ball of the likely cases, beside as many random cases."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from jaxsat.studies.splitting import Evaluate, cube_points
from jaxsat.synthesis.tuning.strategies import new_strategy
from jaxsat.synthesis.worst_case.ball import Ball
from jaxsat.synthesis.worst_case.descent import Flown, descend

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
    left = flights - common
    order = np.argsort(margins[:common], kind="stable")
    starts = [Flown(x[place], int(noise[place]), float(margins[place])) for place in order]
    most = left // 2 // DESCENTS
    descents = [descend(evaluate, ball, whole, one, most) for one in starts[:DESCENTS]]
    left -= sum(one.flights for one in descents)
    least = int(np.argmin([one.end.margin for one in descents]))
    others = starts[:least] + starts[least + 1 :]
    for turn, start in enumerate([descents[least].end, *others]):
        if left > 0:
            left -= _adapt(evaluate, ball, start, (seed + turn) % 2**31, left)
    gradients, trusted = (
        sum(counts) for counts in zip(*(one[2:] for one in descents), strict=True)
    )
    return Searched(common, gradients, trusted)


def _adapt(evaluate: Evaluate, ball: Ball, start: Flown, seed: int, most: int) -> int:
    """Evaluate generations about a start until they converge; return the number of cases."""
    strategy = new_strategy(start.x, seed, bounds=(-np.inf, np.inf), deviation=DEVIATION)
    done = 0
    while done < most and strategy.result.stds.max() > CONVERGED:
        y = np.array(strategy.ask())[: most - done]
        margins = evaluate(cube_points(ball.reflected(y)), np.full(len(y), start.noise, np.uint32))
        done += len(y)
        if done < most:
            ranks = np.argsort(np.argsort(margins, kind="stable"))  # margins may be infinite
            strategy.tell(list(y), ranks.astype(float).tolist())
    return done
