"""One explicit Runge-Kutta step from the tableau of a diffrax solver, in plain arithmetic."""

from collections.abc import Callable

import diffrax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree


def tableau_of(solver: diffrax.AbstractSolver) -> diffrax.ButcherTableau:
    """The solver's tableau; raises `ValueError` for a solver that is not explicit Runge-Kutta."""
    tableau = getattr(solver, "tableau", None)
    if not isinstance(tableau, diffrax.ButcherTableau) or tableau.implicit:
        raise ValueError(
            "Argument `solver` must be an explicit Runge-Kutta solver of diffrax, "
            f"but got {type(solver).__name__}."
        )
    return tableau


def explicit_step(
    tableau: diffrax.ButcherTableau,
    rate: Callable[[Float[Array, ""], PyTree], PyTree],
    t: Float[Array, ""],
    step: Float[Array, ""],
    state: PyTree,
) -> PyTree:
    """The state after one step; the stages that the solution does not use are left out.

    Stages are combined as one flat vector, which in a batch takes a few times less than leaf by
    leaf.
    """
    flat, restore = ravel_pytree(state)
    rows = [np.zeros(0), *tableau.a_lower]
    nodes = [0.0, *tableau.c]
    rates: dict[int, Array] = {}
    for stage in sorted(_needed_stages(tableau)):
        there = restore(_combined(flat, step, rows[stage], rates))
        rates[stage] = ravel_pytree(rate(t + nodes[stage] * step, there))[0]
    return restore(_combined(flat, step, tableau.b_sol, rates))


def step_with_error(
    tableau: diffrax.ButcherTableau,
    rate: Callable[[Float[Array, ""], PyTree], PyTree],
    t: Float[Array, ""],
    step: Float[Array, ""],
    state: PyTree,
) -> tuple[PyTree, PyTree]:
    """The state after one step and the embedded estimate of its error, from all stages."""
    flat, restore = ravel_pytree(state)
    rows = [np.zeros(0), *tableau.a_lower]
    rates: dict[int, Array] = {}
    for stage, (row, node) in enumerate(zip(rows, [0.0, *tableau.c], strict=False)):
        there = restore(_combined(flat, step, row, rates))
        rates[stage] = ravel_pytree(rate(t + node * step, there))[0]
    after = _combined(flat, step, tableau.b_sol, rates)
    return restore(after), restore(_combined(jnp.zeros_like(flat), step, tableau.b_error, rates))


def _needed_stages(tableau: diffrax.ButcherTableau) -> set[int]:
    needed = {stage for stage, weight in enumerate(tableau.b_sol) if weight != 0}
    for stage in range(len(tableau.b_sol) - 1, 0, -1):
        if stage in needed:
            row = tableau.a_lower[stage - 1]
            needed |= {earlier for earlier, weight in enumerate(row) if weight != 0}
    return needed


def _combined(state: Array, step, weights: np.ndarray, rates: dict[int, Array]) -> Array:
    used = [(float(weights[j]), rates[j]) for j in rates if j < len(weights) and weights[j] != 0]
    return state + step * sum(weight * slope for weight, slope in used) if used else state
