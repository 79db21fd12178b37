"""One explicit Runge-Kutta step from the tableau of a diffrax solver, in plain arithmetic."""

import operator
from collections.abc import Callable
from functools import reduce

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


def stage_rates(
    tableau: diffrax.ButcherTableau,
    rate: Callable[[Float[Array, ""], Float[Array, " n"]], Float[Array, " n"]],
    t: Float[Array, ""],
    step: Float[Array, ""],
    state: Float[Array, " n"],
    first: Float[Array, " n"],
) -> list[Float[Array, " n"]]:
    """The rates at all stages of a step of a flat state, whose rate is `first` where it begins."""
    rates: dict[int, Array] = {0: first}
    for stage, (row, node) in enumerate(zip(tableau.a_lower, tableau.c, strict=True), 1):
        rates[stage] = rate(t + node * step, _combined(state, step, row, rates))
    return list(rates.values())


def weighted(weights: np.ndarray, rates: list[Float[Array, " n"]]) -> Float[Array, " n"]:
    """The sum of the rates by their weights, those of zero left out."""
    used = [float(w) * rate for w, rate in zip(weights, rates, strict=True) if w != 0]
    return reduce(operator.add, used) if used else jnp.zeros_like(rates[0])


def middle_weights(solver: diffrax.AbstractSolver) -> Float[np.ndarray, " stages"]:
    """Weights of the stages in how far the state has come in the middle of a step.

    That is where a solver's own dense output is then. Rates and growth at both ends give the rest
    of it: it is of fourth order and has one derivative across steps. Raises `ValueError` for a
    solver other than Tsit5 and Dopri5. The last stage of both is at the end of the step, in the
    state there.
    """
    if isinstance(solver, diffrax.Tsit5):
        return _TSIT5_MIDDLE
    if isinstance(solver, diffrax.Dopri5):  # (a class, typed as a function)
        return getattr(solver.interpolation_cls, "c_mid")  # noqa: B009
    raise ValueError(
        "Argument `solver` must be Tsit5 or Dopri5 where steps are adaptive, "
        f"but got {type(solver).__name__}."
    )


def _tsit5_middle() -> np.ndarray:
    """From the factored polynomials in section 5 of Tsitouras, Comput. Math. Appl. 62 (2011)."""
    half = 0.5

    def quadratic(linear, constant):
        return (half - linear) * half + constant

    return np.array(
        [
            -1.0530884977290216
            * half
            * (half - 1.3299890189751412)
            * quadratic(1.4364028541716351, 0.7139816917074209),
            0.1017 * half**2 * quadratic(2.1966568338249754, 1.2949852507374631),
            2.490627285651252793 * half**2 * quadratic(2.38535645472061657, 1.57803468208092486),
            -16.54810288924490272
            * half**2
            * (half - 1.21712927295533244)
            * (half - 0.61620406037800089),
            47.37952196281928122
            * half**2
            * (half - 1.203071208372362603)
            * (half - 0.658047292653547382),
            -34.87065786149660974 * half**2 * (half - 1.2) * (half - 2 / 3),
            2.5 * half**2 * (half - 1.0) * (half - 0.6),
        ]
    )


_TSIT5_MIDDLE = _tsit5_middle()


def _needed_stages(tableau: diffrax.ButcherTableau) -> set[int]:
    needed = {stage for stage, weight in enumerate(tableau.b_sol) if weight != 0}
    for stage in range(len(tableau.b_sol) - 1, 0, -1):
        if stage in needed:
            row = tableau.a_lower[stage - 1]
            needed |= {earlier for earlier, weight in enumerate(row) if weight != 0}
    return needed


def _combined(state: Array, step, weights: np.ndarray, rates: dict[int, Array]) -> Array:
    used = [(float(weights[j]), rates[j]) for j in rates if j < len(weights) and weights[j] != 0]
    if len(used) == 1:
        ((weight, slope),) = used
        return state + (step * weight) * slope  # one operation an element
    return state + step * reduce(operator.add, (w * k for w, k in used)) if used else state
