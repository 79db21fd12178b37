"""Batches of equal size, so that the bits of a case do not depend on the other cases."""

import abc
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from jaxsat.core.fingerprint import fingerprint
from jaxsat.core.jaxprs import Jaxpr, jaxpr_of
from jaxsat.core.process import no_collection
from jaxsat.core.trees import strong
from jaxsat.simulation.engine.interface import AbstractEngine, CostGradient, Mode, count_of
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.trajectory import Signals

SPARE = 8
"""Lanes of padding behind the last case.

A compiler may pass the last few lanes, one vector of them, through a scalar copy of a loop that
rounds differently: reading two of three components needs one, so as not to read past the end. A
batch of one case always has the same place and needs no padding.
"""


class AbstractBatchEngine(AbstractEngine):
    """An engine whose cases go through one compiled program, `batch_size` at a time.

    The program has `padded_size` lanes, so that the bits of a case depend neither on the number of
    other cases, nor on their identity, nor on its place.
    """

    @property
    def padded_size(self) -> int:
        """Number of lanes of a batch, padding included."""
        return self.batch_size + SPARE if self.batch_size > 1 else 1

    @abc.abstractmethod
    def run_batch(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of a padded batch."""

    @abc.abstractmethod
    def observe_batch(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs and signals (times after cases) of a padded batch.

        Signals are taken at the beginning of the intervals of these numbers, ascending from 0 to
        the end.
        """

    @abc.abstractmethod
    def differentiate_batch(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of a padded batch and the derivatives of its costs."""

    @no_collection()
    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, Jaxpr]:
        """The operations of a batch.

        The numbers of engine and program are inputs. JAX keeps the traces of compiled functions, so
        the first run of such a batch is not traced again.
        """
        engine, program, gains = strong((self, program, gains))
        numbers, rest = eqx.partition((engine, program), eqx.is_array)

        def of_batch(array: Any) -> jax.ShapeDtypeStruct:
            kind = jax.dtypes.canonicalize_dtype(array.dtype)
            return jax.ShapeDtypeStruct((self.padded_size, *array.shape[1:]), kind)

        def run(numbers, cases, gains):
            engine, program = eqx.combine(numbers, rest)
            if mode is None:
                return engine.run_batch(program, cases, gains)
            return engine.differentiate_batch(program, cases, gains, mode)

        return {"batch": jaxpr_of(run, numbers, jax.tree.map(of_batch, cases), gains)}

    def operations(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> str:
        """The fingerprint of the operations of a batch."""
        return fingerprint(self.traced(program, cases, gains, mode))

    def evaluate(self, program: Program, cases: PyTree, gains: PyTree = None) -> Outputs:
        """Outputs of all cases."""
        return self._in_batches(self.run_batch, program, cases, gains)

    def gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode = "forward"
    ) -> CostGradient:
        """Outputs of all cases, and the derivative of each case's cost by `gains`."""
        return self._in_batches(self.differentiate_batch, program, cases, gains, mode)

    def observed(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs with the bits of `evaluate`, and signals (cases, times) at `instants`."""
        return self._in_batches(self.observe_batch, program, cases, gains, instants)

    def _in_batches(self, run, program: Program, cases: PyTree, gains: PyTree, *rest):
        count = count_of(cases)
        program, gains = strong((program, gains))
        cases = jax.tree.map(np.asarray, cases)
        batches = []
        for first in range(0, count, self.batch_size):
            batch = jax.tree.map(lambda x: x[first : first + self.batch_size], cases)  # noqa: B023
            with jax.debug_nans(False):  # NaN marks missing values
                lane_results = run(program, jax.tree.map(self._pad, batch), gains, *rest)
            batches.append(jax.tree.map(lambda x: np.asarray(x)[: self.batch_size], lane_results))
        return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *batches)

    def _pad(self, batch: np.ndarray) -> Array:
        missing = self.padded_size - len(batch)
        return jnp.asarray(np.concatenate([batch, np.repeat(batch[:1], missing, axis=0)]))
