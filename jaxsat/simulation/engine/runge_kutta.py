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
from jaxsat.core.jax_internals import jaxpr_as_fun
from jaxsat.core.once import once
from jaxsat.core.package_files import data_of
from jaxsat.core.solvers import NamedSolver, Solver, class_name, known_class
from jaxsat.simulation.assessment import IntegrationError, stop_gradient
from jaxsat.simulation.engine.program import Program
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Tableau(NamedTuple):
    """Butcher tableau: stage coefficients, nodes, weights of solution and error, and the order.

    `dense` are the coefficients of the dense output of the named solvers that have one.
    """

    a_lower: tuple[np.ndarray, ...]
    c: np.ndarray
    b_sol: np.ndarray
    b_error: np.ndarray
    order: int
    dense: np.ndarray | None = None


EULER = Tableau((), np.zeros(0), np.ones(1), np.zeros(1), 1)
"""Tableau of Euler's method, for which diffrax has none."""


def require_explicit(solver: Solver) -> None:
    """Raise `ValueError` for a solver that is not explicit Runge-Kutta, as all named ones are."""
    if not isinstance(solver, NamedSolver):
        tableau_of(solver)


def tableau_of(solver: Solver) -> Tableau:
    """The solver's tableau; raises `ValueError` for a solver that is not explicit Runge-Kutta."""
    if known_class(solver) == "Euler":
        return EULER
    if isinstance(solver, NamedSolver):
        return _named_tableau(solver.name)
    own = getattr(solver, "tableau", None)
    if getattr(own, "implicit", True):
        raise ValueError(
            "Argument `solver` must be an explicit Runge-Kutta solver of diffrax, "
            f"but got {class_name(solver)}."
        )
    order = solver.order(None)
    assert own is not None
    assert order is not None
    return Tableau(own.a_lower, own.c, own.b_sol, own.b_error, order)


@once
def _named_tableau(name: str) -> Tableau:
    """The tableau of diffrax's solver of a name, without importing diffrax."""
    table = data_of("jaxsat.simulation.engine", "tableaus.toml")[name]
    rows = tuple(map(np.array, table.pop("a_lower")))
    order = table.pop("order")
    return Tableau(rows, order=order, **{key: np.array(value) for key, value in table.items()})


def explicit_step(
    tableau: Tableau,
    rate: Callable[[RealScalar, PyTree], PyTree],
    t: RealScalar,
    step: RealScalar,
    state: PyTree,
) -> PyTree:
    """The state after one step; stages that the solution does not use are skipped.

    Stages are combined as one flat vector, in a batch a few times faster than leaf by leaf. The
    rate is traced once for all stages, and its operations are written out in each.
    """
    # `jax.jit(inline=True)` would lose the operations' places in the source. JAX cannot hash a rate
    # that is a loop.
    traced = jaxpr_as_fun(jax.make_jaxpr(lambda t, state: rate(t, state))(t + 0.0 * step, state))
    flat, restore = ravel_pytree(state)
    rows = [np.zeros(0), *tableau.a_lower]
    nodes = [0.0, *tableau.c]
    rates: dict[int, Array] = {}
    for stage in sorted(_needed_stages(tableau)):
        stage_state = restore(_combine(flat, step, rows[stage], rates))
        arguments = jax.tree.leaves((t + nodes[stage] * step, stage_state))
        rates[stage] = ravel_pytree(traced(*arguments))[0]
    return restore(_combine(flat, step, tableau.b_sol, rates))


def stage_rates(
    tableau: Tableau,
    rate: Callable[[RealScalar, Float[Array, " n"]], Float[Array, " n"]],
    t: RealScalar,
    step: RealScalar,
    state: Float[Array, " n"],
    first: Float[Array, " n"],
) -> list[Float[Array, " n"]]:
    """The rates at all stages of a step of a flat state, whose initial rate is `first`."""
    rates: dict[int, Array] = {0: first}
    for stage, (row, node) in enumerate(zip(tableau.a_lower, tableau.c, strict=True), 1):
        rates[stage] = rate(t + node * step, _combine(state, step, row, rates))
    return list(rates.values())


def weighted(weights: np.ndarray, rates: list[Float[Array, " n"]]) -> Float[Array, " n"]:
    """The weighted sum of the rates, without terms of zero weight."""
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
        return state + (step * weight) * slope  # one operation per element
    return state + step * reduce(operator.add, (w * k for w, k in terms)) if terms else state


class Span(NamedTuple):
    """A time interval without a sample or an edge: begin, length (s), and the states at both
    ends."""

    begin: RealScalar
    length: RealScalar
    first: PyTree
    last: PyTree


Rate = Callable[[RealScalar, PyTree], PyTree]
"""Rate of a state at a time (s)."""


class HalvedSteps(NamedTuple):
    """Integration of a span once more with twice as many steps, see `IntegrationError`.

    The span has been integrated in `substeps` steps. `integrate` returns the state after equal
    steps, from a rate, an initial time (s), a length (s), the number of steps and a state.
    `plant_at` returns the plant of a state at a time.
    """

    program: Program
    integrate: Callable[[Rate, RealScalar, RealScalar, int, PyTree], PyTree]
    substeps: int
    body: RigidBody
    plant_at: Callable[[RealScalar, PyTree], PlantState]

    def after(
        self, error: IntegrationError | None, number: Array, rate: Rate, span: Span
    ) -> IntegrationError | None:
        """The estimate after a span of interval `number`, with `rate` as the state's rate.

        A program that estimates one of several intervals weights each estimate with their number.
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
