"""Covariance matrix adaptation (N. Hansen's `cma`) over a search, without derivatives.

Its state is its history: asked and told the same again it gives the same population, so that a run
is resumed from the records of its steps alone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxsat.synthesis.tuning.parameters import SearchSpace, Values

INITIAL_DEVIATION = 0.25
"""First standard deviation, in parts of the bounds' distance in the search."""

PACKAGE = "cma"


def search_bounds(space: SearchSpace) -> tuple[np.ndarray, np.ndarray]:
    """The least and largest point of the search."""
    ends = space.projected(np.array([[-1e3] * space.size, [1e3] * space.size]))
    return ends[0], ends[1]


def new_strategy(first: np.ndarray, seed: int, population: int | None = None) -> Any:
    """A strategy in the unit cube from a first mean; it ends by nothing but its caller."""
    import cma

    options = {
        "bounds": [0.0, 1.0],
        "seed": seed + 1,  # zero would mean the clock
        "verbose": -9,
        "maxiter": 10**9,
        "tolfun": 0,
        "tolfunhist": 0,
        "tolx": 0,
    }
    if population is not None:
        options["popsize"] = population
    return cma.CMAEvolutionStrategy(np.clip(first, 0.0, 1.0), INITIAL_DEVIATION, options)


def next_population(
    space: SearchSpace,
    start: np.ndarray,
    seed: int,
    population: int,
    history: Sequence[tuple[Values, np.ndarray]],
) -> Values:
    """The points (population, parameters) to try after a history of points and their losses.

    The first population has the `start` itself, a point of the search, in it. A loss that is not
    finite counts as worse than all others.
    """
    low, high = search_bounds(space)
    strategy = new_strategy((start - low) / (high - low), seed, population)
    asked = np.array(strategy.ask())
    for points, losses in history:
        finite = losses[np.isfinite(losses)]
        worst = float(finite.max(initial=0.0)) + 1.0
        told = np.where(np.isfinite(losses), losses, worst)
        strategy.tell(list((points - low) / (high - low)), told.tolist())
        asked = np.array(strategy.ask())
    found = low + (high - low) * asked
    return found if history else np.concatenate([start[None], found[1:]])
