"""Reference of the flight code: its program, compiled without fused operations."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jaxtyping import Float, PyTree

from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.flight.flight import Input, State
from jaxsat.flight.program import FlightProgram


class Reference:
    """The entry points of a program, compiled without fused operations.

    All inputs and states have a leading axis of cases, which share the parameters. Results are rows
    of outputs and next states.
    """

    def __init__(self, program: FlightProgram):
        self.program = program
        self._defaults = [np.asarray(x) for x in program.parameters]
        self._compiled: dict[str, Mapped] = {}

    def step(
        self, now: Input, state: State, parameters: list | None = None
    ) -> Float[np.ndarray, "n expected"]:
        """Return outputs and next states of samples."""
        whole = self.program.whole
        cases = (_since(state, now), state._replace(begin_sample=None))
        examples = (self.program.now, self.program.start_state)
        out, after = self._run("step", whole, examples, cases, parameters)
        return rows_of((out, after._replace(begin_sample=state.begin_sample)))

    def begin(
        self, attitude: Float[np.ndarray, "n q"], now: Input, parameters: list | None = None
    ) -> Float[np.ndarray, "n state"]:
        """Return states before samples; without an estimator attitudes have no numbers."""
        zero = now._replace(sample=np.zeros_like(now.sample))
        examples = (np.zeros(attitude.shape[1:]), self.program.now)
        after = self._run("begin", self.program.start, examples, (attitude, zero), parameters)
        return rows_of(after._replace(begin_sample=now.sample))

    def coast(
        self, now: Input, state: State, parameters: list | None = None
    ) -> Float[np.ndarray, "n state"]:
        """Return states after samples of the estimator alone."""
        cases = (_since(state, now), state.estimator)
        examples = (self.program.now, self.program.start_state.estimator)
        memory = self._run("coast", self.program.coast, examples, cases, parameters)
        return rows_of(state._replace(estimator=memory))

    def _run(
        self, name: str, function: Callable, examples: tuple, cases: tuple, parameters: list | None
    ) -> Any:
        single = self.program.single
        with jax.enable_x64(not single), np.errstate(all="ignore"):
            if name not in self._compiled:

                def call(case, shared):
                    return function(shared, *case)

                like = jax.tree.map(lambda x: np.zeros(x.shape, _type(x, single)), examples)
                self._compiled[name] = Mapped(
                    call, like, self.program.parameters, contract=False, kept=True
                )
            cases = jax.tree.map(
                lambda x, like: np.asarray(x).astype(_type(like, single)), cases, examples
            )
            return self._compiled[name](cases, parameters or self._defaults)


def _since(state: State, now: Input) -> Input:
    """Return the input with its sample number counted from the begin."""
    begin: Any = state.begin_sample
    with np.errstate(over="ignore"):
        return now._replace(sample=now.sample - begin)


def _type(array: Any, single: bool) -> np.dtype:
    return np.dtype(np.float32) if single and array.dtype == np.float64 else array.dtype


def rows_of(tree: PyTree, count: int | None = None) -> Float[np.ndarray, "n numbers"]:
    """Return the arrays of a tree, which share their leading axis, as rows of doubles.

    With a `count` of rows they share any axes of so many elements.
    """
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(tree) if np.size(leaf)]
    parts = [leaf.reshape(count or len(leaf), -1).astype(float) for leaf in leaves]
    return np.concatenate(parts, axis=1) if parts else np.zeros((count or 0, 0))
