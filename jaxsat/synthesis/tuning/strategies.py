"""Covariance matrix adaptation (N. Hansen's `cma`) and BFGS (optimistix') over a search.

The state of the former is its history: asked and told the same again it gives the same population,
so that a run is resumed from the records of its steps alone.
"""

from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

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
    sample = np.array(strategy.ask())
    for points, losses in history:
        finite = losses[np.isfinite(losses)]
        worst = float(finite.max(initial=0.0)) + 1.0
        finite_losses = np.where(np.isfinite(losses), losses, worst)
        strategy.tell(list((points - low) / (high - low)), finite_losses.tolist())
        sample = np.array(strategy.ask())
    following = low + (high - low) * sample
    return following if history else np.concatenate([start[None], following[1:]])


Vector = Float[np.ndarray, " n"]


def minimise(
    gradient: Callable[[Vector], tuple[float, Vector]], start: Vector, low: Vector, high: Vector
) -> Vector:
    """BFGS from `start` until it ends or `gradient` raises; beyond the bounds it is flat.

    `gradient` gives value and gradient at a point within the bounds. A step of optimistix looks at
    its function at one point only, which is known beforehand, so it is given the tangent there.
    """
    import optimistix  # takes its time, and a descent needs none

    solver = optimistix.BFGS(rtol=1e-8, atol=1e-8)
    point = jnp.asarray(start)
    options, tags = {}, frozenset()
    scalar = jax.ShapeDtypeStruct((), point.dtype)
    state = solver.init(lambda y, _: (jnp.sum(y), None), point, None, options, scalar, None, tags)

    @eqx.filter_jit
    def step(point, state, value, slope):
        there = state.y_eval

        def tangent(y, _):
            return value + jnp.sum(slope * (y - there)), None

        point, state, _ = solver.step(tangent, point, None, options, state, tags)
        return point, state, solver.terminate(tangent, point, None, options, state, tags)[0]

    done = False
    while not done:
        trial = np.asarray(state.y_eval)
        inside = np.clip(trial, low, high)
        value, slope = gradient(inside)
        slope = np.where(trial == inside, slope, 0.0)
        point, state, done = step(point, state, jnp.asarray(value), jnp.asarray(slope))
    return np.clip(np.asarray(point), low, high)
