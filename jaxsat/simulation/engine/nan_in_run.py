"""Origin of a NaN in the derivative of a run's cost: the time and the operation.

A run is pushed forward interval by interval with its derivative along one direction of the gains.
In the interval in which the derivative of the cost becomes NaN its operations are computed one
after the other (see `nan_origin`); a NaN from the state is traced back to its origin.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.simulation.engine.fixed import stepper_for
from jaxsat.simulation.engine.nan_origin import Origin, nan_origins
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.stepper import AbstractStepper


class NanInRun(NamedTuple):
    """The operation that produces the NaN, and the time (s) at which its interval begins."""

    origin: Origin
    time: float


class _DualProgress(NamedTuple):
    """The real-valued leaves of a progress, their derivatives, and the other leaves."""

    numbers: PyTree
    slopes: PyTree
    rest: PyTree


class _Case(NamedTuple):
    """A case of a program, and the direction in the gains (both trees) of its derivative."""

    stepper: AbstractStepper
    program: Program
    case: PyTree
    gains: PyTree
    direction: PyTree

    def begin(self) -> _DualProgress:
        """The progress at time zero, with its derivative."""
        return self._push(self._begin, (self.gains,), (self.direction,))

    def after(self, before: _DualProgress, number: Any) -> _DualProgress:
        """The progress after interval `number`, with its derivative."""

        def advanced(gains, numbers):
            stepper, case = self._stepper_and_case(gains)
            progress = eqx.combine(numbers, before.rest)
            return stepper.advance(self.program, case, progress, number, 1)

        primals, tangents = (self.gains, before.numbers), (self.direction, before.slopes)
        return self._push(advanced, primals, tangents)

    def cost(self, end: _DualProgress) -> tuple[Any, Any]:
        """The cost and its derivative."""

        def finished(gains, numbers):
            stepper, case = self._stepper_and_case(gains)
            progress = eqx.combine(numbers, end.rest)
            count = jnp.array(self.program.intervals)
            return stepper.finish(self.program, case, progress, count).cost

        primals, tangents = (self.gains, end.numbers), (self.direction, end.slopes)
        return jax.jvp(finished, primals, tangents)

    def _begin(self, gains):
        stepper, case = self._stepper_and_case(gains)
        return stepper.begin(self.program, case)

    def _stepper_and_case(self, gains):
        case = self.program.case_factory(self.case, gains)
        return stepper_for(self.stepper, case.loop), case

    @staticmethod
    def _push(function: Callable, primals: tuple, tangents: tuple) -> _DualProgress:
        def split(*primals):
            return eqx.partition(function(*primals), eqx.is_inexact_array)

        return _DualProgress(*jax.jvp(split, primals, tangents, has_aux=True))


def nan_in_run(
    stepper: AbstractStepper, program: Program, case: PyTree, gains: PyTree, direction: PyTree
) -> NanInRun | None:
    """Origin of a NaN in the derivative of a case's cost along a `direction` of the gains.

    None without a NaN, also where the derivative is infinite.
    """
    run = _Case(stepper, program, case, gains, direction)
    states = [run.begin()]
    origins = nan_origins(run.after, states[0], jnp.array(0))
    cost = _place_of_cost(states[0])
    early = origins[cost]
    if early is not None and early.argument is None:
        return NanInRun(early, 0.0)
    after = jax.jit(run.after)
    for number in range(program.intervals):
        states.append(after(states[-1], jnp.array(number)))
        if _is_nan(states[-1])[cost]:
            return _follow_back(run, states, number, cost)
    return _origin_at_end(run, states)


def _origin_at_end(run: _Case, states: list[_DualProgress]) -> NanInRun | None:
    """The origin of a NaN in the cost's evaluation from the last state."""
    origin = nan_origins(run.cost, states[-1])[1]
    if origin is not None and origin.argument is not None:
        return _follow_back(run, states, _first(states, origin.argument) - 1, origin.argument)
    end = float(np.asarray(run.program.duration))
    return None if origin is None else NanInRun(origin, end)


def _follow_back(
    run: _Case, states: list[_DualProgress], number: int, leaf: int
) -> NanInRun | None:
    """The origin of a leaf's NaN after interval `number`, traced back interval by interval."""
    while number >= 0:
        origin = nan_origins(run.after, states[number], jnp.array(number))[leaf]
        if origin is None:
            return None
        if origin.argument is None:
            return NanInRun(origin, number * float(np.asarray(run.program.interval)))
        leaf = origin.argument
        number = _first(states[: number + 1], leaf) - 1
    origin = nan_origins(run.begin)[leaf]
    return None if origin is None else NanInRun(origin, 0.0)


def _place_of_cost(state: _DualProgress) -> int:
    """Number of the leaf that contains the derivative of the cost."""
    leaves = jax.tree.leaves(state._replace(slopes=None, rest=None))
    numbered = jax.tree.unflatten(
        jax.tree.structure(state.slopes), range(len(jax.tree.leaves(state.slopes)))
    )
    return len(leaves) + numbered.integrals.cost


def _first(states: list[_DualProgress], leaf: int) -> int:
    """Index of the first state from which a leaf is NaN up to the last of them."""
    number = len(states) - 1
    while number > 0 and _is_nan(states[number - 1])[leaf]:
        number -= 1
    return number


def _is_nan(state: _DualProgress) -> list[bool]:
    return [
        bool(jnp.issubdtype(x.dtype, jnp.inexact) and np.isnan(np.asarray(x)).any())
        for x in map(jnp.asarray, jax.tree.leaves(state))
    ]
