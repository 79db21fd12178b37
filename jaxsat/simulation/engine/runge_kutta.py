"""One explicit Runge-Kutta step from the tableau of a diffrax solver, in plain arithmetic;
and the error of equal steps."""

import operator
from collections.abc import Callable
from functools import reduce
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import RealScalar
from jaxsat.core.solvers import NamedSolver, Solver, class_name, known_class, solver_of
from jaxsat.simulation.assessment import IntegrationError, stop_gradient
from jaxsat.simulation.engine.program import Program
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Tableau(NamedTuple):
    """Butcher's: stages from those before them, their nodes, and weights of solution and error."""

    a_lower: tuple[np.ndarray, ...]
    c: np.ndarray
    b_sol: np.ndarray
    b_error: np.ndarray


EULER = Tableau((), np.zeros(0), np.ones(1), np.zeros(1))
"""Which diffrax has without a tableau."""


def require_explicit(solver: Solver) -> None:
    """Raise `ValueError` for a solver that is not explicit Runge-Kutta, as all with names are."""
    if not isinstance(solver, NamedSolver):
        tableau_of(solver)


def tableau_of(solver: Solver) -> Tableau:
    """The solver's tableau; raises `ValueError` for a solver that is not explicit Runge-Kutta."""
    if known_class(solver) == "Euler":
        return EULER
    own = getattr(solver_of(solver), "tableau", None)
    if getattr(own, "implicit", True):
        raise ValueError(
            "Argument `solver` must be an explicit Runge-Kutta solver of diffrax, "
            f"but got {class_name(solver)}."
        )
    assert own is not None
    return Tableau(own.a_lower, own.c, own.b_sol, own.b_error)


def explicit_step(
    tableau: Tableau,
    rate: Callable[[RealScalar, PyTree], PyTree],
    t: RealScalar,
    step: RealScalar,
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
        there = restore(_combine(flat, step, rows[stage], rates))
        rates[stage] = ravel_pytree(rate(t + nodes[stage] * step, there))[0]
    return restore(_combine(flat, step, tableau.b_sol, rates))


def stage_rates(
    tableau: Tableau,
    rate: Callable[[RealScalar, Float[Array, " n"]], Float[Array, " n"]],
    t: RealScalar,
    step: RealScalar,
    state: Float[Array, " n"],
    first: Float[Array, " n"],
) -> list[Float[Array, " n"]]:
    """The rates at all stages of a step of a flat state, whose rate is `first` where it begins."""
    rates: dict[int, Array] = {0: first}
    for stage, (row, node) in enumerate(zip(tableau.a_lower, tableau.c, strict=True), 1):
        rates[stage] = rate(t + node * step, _combine(state, step, row, rates))
    return list(rates.values())


def weighted(weights: np.ndarray, rates: list[Float[Array, " n"]]) -> Float[Array, " n"]:
    """The sum of the rates by their weights, those of zero left out."""
    terms = [float(w) * rate for w, rate in zip(weights, rates, strict=True) if w != 0]
    return reduce(operator.add, terms) if terms else jnp.zeros_like(rates[0])


def _needed_stages(tableau: Tableau) -> set[int]:
    stages = {stage for stage, weight in enumerate(tableau.b_sol) if weight != 0}
    for stage in range(len(tableau.b_sol) - 1, 0, -1):
        if stage in stages:
            row = tableau.a_lower[stage - 1]
            stages |= {earlier for earlier, weight in enumerate(row) if weight != 0}
    return stages


def _combine(state: Array, step, weights: np.ndarray, rates: dict[int, Array]) -> Array:
    terms = [(float(weights[j]), rates[j]) for j in rates if j < len(weights) and weights[j] != 0]
    if len(terms) == 1:
        ((weight, slope),) = terms
        return state + (step * weight) * slope  # one operation an element
    return state + step * reduce(operator.add, (w * k for w, k in terms)) if terms else state


class Span(NamedTuple):
    """A time without a sample or an edge: begin and length (s), and the state at both ends."""

    begin: RealScalar
    length: RealScalar
    first: PyTree
    last: PyTree


Rate = Callable[[RealScalar, PyTree], PyTree]
"""That of a state at a time (s)."""


class HalvedSteps(NamedTuple):
    """Integrates a span once more in twice as many steps, see `IntegrationError`.

    The span has been integrated in `substeps` steps. `integrate` gives the state after equal steps:
    of a rate, from a time (s) on, over a length (s), so many, from a state. `plant_at` gives the
    plant of a state at a time.
    """

    program: Program
    integrate: Callable[[Rate, RealScalar, RealScalar, int, PyTree], PyTree]
    substeps: int
    body: RigidBody
    plant_at: Callable[[RealScalar, PyTree], PlantState]

    def after(
        self, error: IntegrationError | None, number: Array, rate: Rate, span: Span
    ) -> IntegrationError | None:
        """The estimate with a span of interval `number`, along which `rate` is the state's.

        A program that estimates every so many intervals counts each of these for all of them.
        """
        every = self.program.error_every
        if error is None:
            return None
        begin, length, first, last = stop_gradient(span)
        end = begin + length

        def estimated():
            halved = self.integrate(rate, begin, length, 2 * self.substeps, first)
            halved = self.plant_at(end, halved)
            return error.after(self.body, length, self.plant_at(end, last), halved, float(every))

        def carried():
            return error.later(length)

        if every == 1:
            return estimated()
        return jax.lax.cond(number % every == 0, estimated, carried)
