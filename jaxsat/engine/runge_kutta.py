"""One explicit Runge-Kutta step from the tableau of a diffrax solver, in plain arithmetic."""

from collections.abc import Callable

import diffrax
import jax
import numpy as np
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
    """The state after one step; the stages that the solution does not use are left out."""
    rows = [np.zeros(0), *tableau.a_lower]
    nodes = [0.0, *tableau.c]
    needed = _needed_stages(tableau)
    rates: dict[int, PyTree] = {}
    for stage in sorted(needed):
        there = _combined(state, step, rows[stage], rates)
        rates[stage] = rate(t + nodes[stage] * step, there)
    return _combined(state, step, tableau.b_sol, rates)


def step_with_error(
    tableau: diffrax.ButcherTableau,
    rate: Callable[[Float[Array, ""], PyTree], PyTree],
    t: Float[Array, ""],
    step: Float[Array, ""],
    state: PyTree,
) -> tuple[PyTree, PyTree]:
    """The state after one step and the embedded estimate of its error, from all stages."""
    rows = [np.zeros(0), *tableau.a_lower]
    nodes = [0.0, *tableau.c]
    rates: dict[int, PyTree] = {}
    for stage, row in enumerate(rows):
        rates[stage] = rate(t + nodes[stage] * step, _combined(state, step, row, rates))
    after = _combined(state, step, tableau.b_sol, rates)
    nothing = jax.tree.map(lambda x: x * 0, state)
    return after, _combined(nothing, step, tableau.b_error, rates)


def _needed_stages(tableau: diffrax.ButcherTableau) -> set[int]:
    needed = {stage for stage, weight in enumerate(tableau.b_sol) if weight != 0}
    for stage in range(len(tableau.b_sol) - 1, 0, -1):
        if stage in needed:
            row = tableau.a_lower[stage - 1]
            needed |= {earlier for earlier, weight in enumerate(row) if weight != 0}
    return needed


def _combined(state: PyTree, step, weights: np.ndarray, rates: dict[int, PyTree]) -> PyTree:
    used = [(float(weights[j]), rates[j]) for j in rates if j < len(weights) and weights[j] != 0]
    if not used:
        return state

    def entry(x, *slopes):
        total = sum(weight * slope for (weight, _), slope in zip(used, slopes, strict=True))
        return x + step * total

    return jax.tree.map(entry, state, *[slope for _, slope in used])
