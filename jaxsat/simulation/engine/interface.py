"""Interface of all engines."""

import abc
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float, PyTree

from jaxsat.core.fingerprint import array_text
from jaxsat.core.jaxprs import Jaxpr
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.trajectory import Signals


class Replay(NamedTuple):
    """Replay of one case: its outputs, and its signals at the instants `times` (s)."""

    outputs: Outputs
    times: Float[np.ndarray, " times"]
    signals: Signals


class CostGradient(NamedTuple):
    """Outputs of cases, and the derivatives of their costs, shaped like the gains after a leading
    axis of cases."""

    outputs: Outputs
    derivatives: PyTree


Mode = Literal["forward", "reverse"]
"""Differentiation mode: forward costs one run per gain; reverse a few runs, and memory."""


class AbstractEngine(eqx.Module):
    """An engine runs a program for many cases; the bits of a case do not depend on the others.

    Cases are the entries of arrays along their leading axis. Outputs are NumPy arrays, and a failed
    case raises no error: see `Outputs.code`. At most `batch_size` cases are in memory with their
    histories.
    """

    batch_size: eqx.AbstractVar[int]

    @abc.abstractmethod
    def identity(self) -> dict[str, Any]:
        """The properties of the engine that the bits of a case depend on, as plain data."""

    @abc.abstractmethod
    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, Jaxpr]:
        """The operations that are compiled for such cases, part by part; see `fingerprint`.

        With a `mode` they are the operations of `gradient`. The numbers of the program are inputs.
        """

    @abc.abstractmethod
    def operations(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> str:
        """The `fingerprint` of the result of `traced`."""

    @abc.abstractmethod
    def evaluate(self, program: Program, cases: PyTree, gains: PyTree = None) -> Outputs:
        """Outputs of all cases."""

    @abc.abstractmethod
    def gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode = "forward"
    ) -> CostGradient:
        """Outputs of all cases, and the derivative of each case's cost by `gains`.

        Adaptive steps of the scan and native engines end on a law's corners and give the derivative
        of the cost. Fixed steps and those of diffrax do not, and give that of the smooth pieces,
        which omits the motion of the corners. Raises `ValueError` for reverse mode where the engine
        has none.
        """

    @abc.abstractmethod
    def observed(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs with the bits of `evaluate`, and signals (cases, times) at `instants`.

        `instants` are numbers of intervals, ascending from 0 to the end, as from `program.evenly`.
        """

    def replay(self, program: Program, case: PyTree, gains: PyTree = None) -> Replay:
        """Replay one case (no leading axis) with its history, to the same bits as before."""
        cases = jax.tree.map(lambda x: np.asarray(x)[None], case)
        batch = self.observed(program, cases, gains, program.instants())
        outputs, signals = jax.tree.map(lambda x: np.asarray(x[0]), batch)
        times = np.arange(program.intervals + 1) * float(program.interval)
        return Replay(outputs, times, signals)

    def histories(
        self, program: Program, cases: PyTree, gains: PyTree = None, every: int = 1
    ) -> Signals:
        """Signals (cases, times) of at most `batch_size` cases, at `program.instants(every)`."""
        count = count_of(cases)
        if count > self.batch_size:
            raise ValueError(f"There must be 1 to {self.batch_size} cases, but got {count}.")
        return self.observed(program, cases, gains, program.instants(every))[1]


def stops(instants: Sequence[int], behind: bool) -> Sequence[int]:
    """Interval numbers at which cases stop for observation, in order, from the first of `instants`.

    If signals lie `behind`, at the begin of the last advance, each stop is at the next instant; the
    last advance has length zero.
    """
    return [*instants[1:], instants[-1]] if behind else instants


def with_ranges_ahead(signals: Signals, behind: bool) -> Signals:
    """Histories (cases, times) with torque ranges that extend to the next instant, not from the
    last.

    At the last instant they are the torque there. Signals that lie `behind`, see `stops`, have them
    elsewhere.
    """
    ranges = signals.torque_range
    if ranges is None:
        return signals
    others = slice(None, -1) if behind else slice(1, None)
    ahead = jax.tree.map(
        lambda x: np.concatenate([x[:, others], signals.torque[:, -1:]], 1), ranges
    )
    return eqx.tree_at(lambda one: one.torque_range, signals, ahead)


def count_of(cases: PyTree) -> int:
    """Number of cases along the leading axis of all arrays.

    Raises `ValueError` if there is none, or if the arrays differ.
    """
    leaves = [
        ("cases" + jax.tree_util.keystr(path), np.shape(leaf))
        for path, leaf in jax.tree_util.tree_leaves_with_path(cases)
    ]
    if not leaves:
        raise ValueError("Argument `cases` must hold at least one array, but got none.")
    for name, shape in leaves:
        if not shape:
            raise ValueError(f"Argument `{name}` must have an axis of cases, but got a number.")
        if not shape[0]:
            raise ValueError(f"Argument `{name}` must hold at least one case, but got none.")
        if shape[0] != leaves[0][1][0]:
            raise ValueError(
                f"Argument `{name}` must have {leaves[0][1][0]} cases, as `{leaves[0][0]}` has, "
                f"but got {shape[0]}."
            )
    return leaves[0][1][0]


LISTED = 1 << 14
"""Largest size of an array that an identity lists."""


def program_identity(
    engine: AbstractEngine,
    program: Program,
    cases: PyTree,
    gains: PyTree = None,
    mode: Mode | None = None,
) -> dict[str, Any]:
    """Identity of a program as plain data: numbers, length, and a hash of the operations.

    Arrays of more than `LISTED` numbers are hashed. `cases` are examples; with a `mode` the
    operations are those of the costs' derivatives by `gains`.
    """
    numbers = [leaf for leaf in jax.tree.leaves(program) if eqx.is_array_like(leaf)]
    return {
        "numbers": [
            np.asarray(number).tolist() if np.size(number) <= LISTED else array_text(number)
            for number in numbers
        ],
        "intervals": program.intervals,
        "operations": engine.operations(program, cases, gains, mode),
    }
