"""Covariance matrix adaptation (N. Hansen's `cma`) over a search.

The state of a strategy is its history: the same history gives the same population, so that a run is
resumed from the records of its steps alone.
"""

import importlib.util
from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxsat.synthesis.tuning.parameters import SearchSpace, Values

INITIAL_DEVIATION = 0.25
"""Initial standard deviation, over the distance of the bounds in the search."""

PACKAGE = "cma"


def require_package(what: str) -> None:
    """Raise `ValueError` if the package of the strategies, which `what` needs, is missing."""
    if importlib.util.find_spec(PACKAGE) is None:
        raise ValueError(
            f"{what} must have the package {PACKAGE}: pip install 'jaxsat[baselines]'."
        )


def new_strategy(
    first: np.ndarray,
    seed: int,
    population: int | None = None,
    *,
    bounds: tuple[float, float] = (0.0, 1.0),
    deviation: float = INITIAL_DEVIATION,
) -> Any:
    """Return a strategy from an initial mean and standard deviation, without stopping criteria.

    `bounds` are those of every coordinate and may be infinite.
    """
    import cma

    options = {
        "bounds": list(bounds),
        "seed": seed + 1,  # zero would mean the clock
        "verbose": -9,
        "maxiter": 10**9,
        "tolfun": 0,
        "tolfunhist": 0,
        "tolx": 0,
    }
    if population is not None:
        options["popsize"] = population
    return cma.CMAEvolutionStrategy(np.clip(first, *bounds), deviation, options)


def next_population(
    space: SearchSpace,
    start: np.ndarray,
    seed: int,
    population: int,
    history: Sequence[tuple[Values, np.ndarray]],
) -> Values:
    """Return the points (population, parameters) to try after a history of points and losses.

    The first population contains `start`, a point of the search. A loss that is not finite counts
    as worse than all others.
    """
    low, high = space.ends
    strategy = new_strategy((start - low) / (high - low), seed, population)
    sample = np.array(strategy.ask())
    for points, losses in history:
        finite = losses[np.isfinite(losses)]
        worst = float(finite.max(initial=0.0)) + 1.0
        finite_losses = np.where(np.isfinite(losses), losses, worst)
        strategy.tell(list((points - low) / (high - low)), finite_losses.tolist())
        sample = np.array(strategy.ask())
    following = low + (high - low) * sample
    return following if history else np.concatenate([start[None], following[1:]])
