"""The compiled engine: cases in the lanes of vector registers, blocks of them in threads."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.engine.adaptive import Tolerance
from jaxsat.engine.interface import AbstractEngine, Replay
from jaxsat.engine.native import target
from jaxsat.engine.native.kernel import Kernel, processors
from jaxsat.engine.native.trajectory import trajectory_stages
from jaxsat.engine.program import Program
from jaxsat.engine.progress import Outputs
from jaxsat.engine.runge_kutta import tableau_of
from jaxsat.engine.scan import ScanEngine
from jaxsat.simulation import Signals

_kernels: dict[Any, Kernel] = {}


class NativeEngine(AbstractEngine):
    """Runs a program as machine code made for it, each vector lane one case.

    Steps are those of `ScanEngine` with the same solver, `substeps` and tolerance. `lanes` is the
    number of cases in a vector, by default what suits the processor; `workers` the number of
    threads, by default as many as there are processors. Neither changes a bit of any case.
    `width` is the number of cases whose histories can be had at once.

    Raises `CannotLower` where the program holds something that has no rule, and `RuntimeError`
    without llvmlite or without 64-bit numbers.
    """

    solver: diffrax.AbstractSolver = diffrax.Tsit5()
    substeps: int = eqx.field(static=True, default=20)
    tolerance: Tolerance | None = None
    lanes: int | None = eqx.field(static=True, default=None)
    workers: int | None = eqx.field(static=True, default=None)
    width: int = eqx.field(static=True, default=64)

    def __check_init__(self):
        tableau_of(self.solver)
        for name in ("substeps", "lanes", "workers", "width"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"Argument `{name}` must be at least 1, but got {value}.")
        if not target.LLVMLITE:
            raise RuntimeError("The compiled engine must have llvmlite, which is not installed.")

    def identity(self) -> dict[str, Any]:
        """Solver and steps, and the processor, whose instructions round as they do."""
        host = target.host()
        fixed = {
            "name": "native",
            "solver": type(self.solver).__name__,
            "substeps": self.substeps,
            "llvm": target.version(),
            "vector": host.register * 8,
        }
        if self.tolerance is None:
            return fixed
        numbers = [float(x) for x in jax.tree.leaves(self.tolerance)]
        return fixed | {"tolerance": [*numbers, self.tolerance.max_steps]}

    def kernel(self, program: Program, cases: PyTree, gains: PyTree = None) -> Kernel:
        """The machine code for such a program, made once for all numbers of the same kind."""
        if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
            raise RuntimeError(
                "The compiled engine must have 64-bit numbers; switch jax_enable_x64 on first."
            )
        lanes = self.lanes or target.host().lanes
        examples = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), cases)
        shapes = jax.tree.map(
            lambda x: jax.ShapeDtypeStruct(np.shape(x), np.asarray(x).dtype), gains
        )
        key = (_kind((self._method, program)), _kind(examples), _kind(shapes), lanes)
        if key not in _kernels:
            stages = trajectory_stages(self._method, program, examples, shapes, lanes)
            _kernels[key] = Kernel(stages, lanes)
        return _kernels[key]

    @property
    def _method(self) -> ScanEngine:
        return ScanEngine(self.solver, self.substeps, 1, 1, self.tolerance)

    def evaluate(self, program: Program, cases: PyTree, gains: PyTree = None) -> Outputs:
        """Outputs of all cases, in as many threads as there are workers."""
        cases, count = _counted(cases)
        kernel = self.kernel(program, cases, gains)
        inputs = self._inputs(kernel, cases, program, gains)
        return kernel.run(inputs, count, program.intervals, self.workers or processors())

    def run_block(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of one block."""
        return self.evaluate(program, cases, gains)

    def replay_block(
        self, program: Program, cases: PyTree, gains: PyTree
    ) -> tuple[Outputs, Signals]:
        """Outputs and signals of one block."""
        cases, count = _counted(cases)
        kernel = self.kernel(program, cases, gains)
        inputs = self._inputs(kernel, cases, program, gains)
        return kernel.replay(inputs, count, program.intervals)

    def replay(self, program: Program, case: PyTree, gains: PyTree = None) -> Replay:
        """One case (no leading axis) again, with its history and the same bits as before."""
        cases = jax.tree.map(lambda x: np.asarray(x)[None], case)
        found = self.replay_block(program, cases, gains)
        outputs, signals = jax.tree.map(lambda x: x[0], found)
        times = np.arange(program.intervals + 1) * float(program.interval)
        return Replay(outputs, times, signals)

    def block_gradient(self, program: Program, cases: PyTree, gains: PyTree) -> PyTree:
        """Derivatives of the costs of one block."""
        raise NotImplementedError

    def _inputs(self, kernel: Kernel, cases, program: Program, gains) -> list[np.ndarray]:
        numbers = eqx.filter((self._method, program), eqx.is_array)
        leaves = [*jax.tree.leaves(cases), *jax.tree.leaves(numbers), *jax.tree.leaves(gains)]
        avals = kernel.stages.jaxprs["begin"].in_avals
        return [np.ascontiguousarray(x, a.dtype) for x, a in zip(leaves, avals, strict=True)]


def _counted(cases: PyTree) -> tuple[PyTree, int]:
    cases = jax.tree.map(np.asarray, cases)
    count = len(jax.tree.leaves(cases)[0])
    if not count:
        raise ValueError("Argument `cases` must hold at least one case, but got none.")
    return cases, count


def _kind(tree: PyTree) -> tuple:
    """All of a tree that a program's structure depends on: everything but the numbers."""
    arrays, rest = eqx.partition(tree, lambda x: isinstance(x, jax.Array))
    shapes = [(x.shape, x.dtype.name, bool(x.weak_type)) for x in jax.tree.leaves(arrays)]
    leaves, structure = jax.tree.flatten(rest)
    return tuple(shapes), structure, jax.tree.structure(arrays), tuple(leaves)
