"""What every engine offers."""

import abc
from typing import Any, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr
from jaxtyping import Array, Float, PyTree

from jaxsat.engine.program import Program
from jaxsat.engine.progress import Outputs
from jaxsat.simulation import Signals

SPARE = 8
"""Lanes behind the last case that only hold padding.

A compiler may take the last few lanes, one vector of them, through a scalar copy of a loop that
rounds differently: reading two of three components needs one, so as not to read past the end.
A block of one case has no other place to be in, and needs none.
"""


class Replay(NamedTuple):
    """One case again: its outputs, and its signals at the instants `times` (s)."""

    outputs: Outputs
    times: Float[np.ndarray, " times"]
    signals: Signals


class CostGradient(NamedTuple):
    """Outputs of cases, and the derivatives of their costs, shaped like the gains after the cases'
    axis."""

    outputs: Outputs
    derivatives: PyTree


Mode = Literal["forward", "reverse"]
"""Forward mode costs as many runs as there are gains; reverse mode a few, and memory."""


class AbstractEngine(eqx.Module):
    """Runs a program for many cases, `width` at a time.

    Cases go through one compiled program of as many lanes and some more, the rest padded, so that
    the bits of a case depend neither on how many others there are, nor on which, nor on its place.
    """

    width: eqx.AbstractVar[int]

    @property
    def padded_width(self) -> int:
        """How many lanes a block has, padding included."""
        return self.width + SPARE if self.width > 1 else 1

    @abc.abstractmethod
    def identity(self) -> dict[str, Any]:
        """What of the engine the bits of a case depend on, as plain data."""

    @abc.abstractmethod
    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, ClosedJaxpr]:
        """The operations that are compiled for such cases, part by part; see `fingerprint`.

        With a `mode` they are those of `gradient`. The numbers of the program are inputs.
        """

    @abc.abstractmethod
    def run_block(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of a padded block."""

    @abc.abstractmethod
    def replay_block(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs and signals (times after cases) of a padded block.

        The signals are those at the beginning of the intervals of these numbers, ascending from 0
        to the end.
        """

    @abc.abstractmethod
    def block_gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of a padded block and the derivatives of its costs."""

    def evaluate(self, program: Program, cases: PyTree, gains: PyTree = None) -> Outputs:
        """Outputs of all cases, which are the entries of `cases` along the leading axis.

        Returns NumPy arrays. Nothing is raised where a case fails: see `Outputs.code`.
        """
        return self._in_blocks(self.run_block, program, cases, gains)

    def gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode = "forward"
    ) -> CostGradient:
        """Outputs of all cases, and the derivative of each case's cost by `gains`.

        NumPy arrays. Adaptive steps of the scan and native engines end on a law's switches, and
        theirs is the derivative of the cost; steps that do not, fixed ones or those of diffrax,
        give that of the smooth pieces, which misses how the switches move. Raises `ValueError` for
        reverse mode where the engine has none.
        """

        def run(program, cases, gains):
            return self.block_gradient(program, cases, gains, mode)

        return self._in_blocks(run, program, cases, gains)

    def replay(self, program: Program, case: PyTree, gains: PyTree = None) -> Replay:
        """One case (no leading axis) again, with its history and the same bits as before."""
        cases = jax.tree.map(lambda x: jnp.stack([x] * self.padded_width), case)
        outputs, signals = self.replay_block(program, cases, gains, program.instants())
        outputs, signals = jax.tree.map(lambda x: np.asarray(x[0]), (outputs, signals))
        times = np.arange(program.intervals + 1) * float(program.interval)
        return Replay(outputs, times, signals)

    def histories(
        self, program: Program, cases: PyTree, gains: PyTree = None, every: int = 1
    ) -> Signals:
        """Signals (cases, times) of at most `width` cases, at `program.instants(every)`."""
        count = count_of(cases)
        cases = jax.tree.map(np.asarray, cases)
        if count > self.width:
            raise ValueError(f"There must be 1 to {self.width} cases, but got {count}.")
        padded, instants = jax.tree.map(self._padded, cases), program.instants(every)
        signals = self.replay_block(program, padded, gains, instants)[1]
        return jax.tree.map(lambda x: np.asarray(x[:count]), signals)

    def observed(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """`evaluate`, to the same bits, and signals (cases, times) at `instants`.

        These are numbers of intervals, ascending from 0 to the end, such as `program.evenly` gives.
        """

        def run(program, cases, gains):
            return self.replay_block(program, cases, gains, instants)

        return self._in_blocks(run, program, cases, gains)

    def _in_blocks(self, run, program: Program, cases: PyTree, gains: PyTree):
        count = count_of(cases)
        cases = jax.tree.map(np.asarray, cases)
        blocks = []
        for first in range(0, count, self.width):
            block = jax.tree.map(lambda x: x[first : first + self.width], cases)  # noqa: B023
            found = run(program, jax.tree.map(self._padded, block), gains)
            blocks.append(jax.tree.map(lambda x: np.asarray(x)[: self.width], found))
        return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *blocks)

    def _padded(self, block: np.ndarray) -> Array:
        missing = self.padded_width - len(block)
        return jnp.asarray(np.concatenate([block, np.repeat(block[:1], missing, axis=0)]))


def count_of(cases: PyTree) -> int:
    """How many cases there are along the leading axis of all arrays.

    Raises `ValueError` where there is none, or the arrays differ.
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
