"""The compiled engine: cases in the lanes of vector registers, blocks of them in threads."""

from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.arguments import as_numbers
from jaxsat.compiler.llvm.emitter import require_lanes
from jaxsat.compiler.lowering import CannotLower
from jaxsat.core.checks import require_counts
from jaxsat.core.jaxprs import Jaxpr
from jaxsat.core.once import Locks
from jaxsat.core.process import processors
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.interface import (
    AbstractEngine,
    CostGradient,
    Mode,
    count_of,
    with_ranges_ahead,
)
from jaxsat.simulation.engine.native.kernel import Kernel
from jaxsat.simulation.engine.native.kernel_store import entry_name
from jaxsat.simulation.engine.native.phases import ForwardModePhases, PrimalPhases
from jaxsat.simulation.engine.native.trajectory import (
    LoweredTrajectory,
    lower_trajectory,
    numbers_of,
)
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.engine.stepper import AbstractStepper
from jaxsat.simulation.trajectory import Signals

_kernels: dict[Any, Kernel] = {}
_making = Locks()


NO_LLVMLITE = "the compiled engine must have llvmlite, which is not installed"

NO_64_BITS = "the compiled engine must have 64-bit numbers; switch jax_enable_x64 on first"


class NativeEngine(AbstractEngine):
    """Runs a program as machine code compiled for it, one case per vector lane.

    Steps are those of `ScanEngine` with the same stepper. `simd_lanes` is the number of cases in a
    vector (1, 2, 4, 8 or 16), by default chosen for the processor; `workers` the number of threads,
    by default the number of processors. Neither changes a bit of any case. Arrays are copied: the
    caller may change them during a run.

    Raises `CannotLower` if the program contains an operation without a rule, and `RuntimeError`
    without llvmlite or without 64-bit numbers.
    """

    stepper: AbstractStepper = eqx.field(default_factory=FixedStepper)
    simd_lanes: int | None = eqx.field(static=True, default=None)
    workers: int | None = eqx.field(static=True, default=None)
    batch_size: int = eqx.field(static=True, default=64)

    def __check_init__(self):
        require_counts(simd_lanes=self.simd_lanes, workers=self.workers, batch_size=self.batch_size)
        if self.simd_lanes is not None:
            require_lanes(self.simd_lanes, "simd_lanes")
        obstacle = _llvmlite_obstacle()
        if obstacle is not None:
            raise RuntimeError(obstacle)

    def identity(self) -> dict[str, Any]:
        """Steps, and the processor, whose instructions determine rounding."""
        host = target.host()
        processor = {"llvm": target.version(), "vector": host.register * 8, "fused": host.fuses}
        return {"name": "native", **self.stepper.identity(), **processor}

    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, Jaxpr]:
        """The operations that are compiled to machine code, phase by phase."""
        return self.kernel(program, cases, gains, derivatives=mode is not None).trajectory.jaxprs

    def operations(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> str:
        """The fingerprint of the operations, which may be stored on disk with the machine code."""
        return self.kernel(program, cases, gains, derivatives=mode is not None).operations

    def kernel(
        self, program: Program, cases: PyTree, gains: PyTree = None, *, derivatives: bool = False
    ) -> Kernel:
        """The machine code for such a program, compiled once for all numbers of the same kind.

        Raises `ValueError` without cases or if arrays differ in their number, and `TypeError` for
        leaves that are not numeric arrays.
        """
        cases, gains = _numbers(cases, gains)
        lanes = self.simd_lanes or target.host().lanes
        return _kernel(self.stepper, program, cases, gains, lanes, derivatives)

    def evaluate(self, program: Program, cases: PyTree, gains: PyTree = None) -> Outputs:
        """Outputs of all cases, computed in up to `workers` threads."""
        kernel = self.kernel(program, cases, gains)
        trees = self.trees(cases, program, gains)
        return kernel.run(trees, program.intervals, self.workers or processors())

    def observed(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs with the bits of `evaluate`, and signals at `instants`; in one thread."""
        kernel = self.kernel(program, cases, gains)
        outputs, signals = kernel.replay(self.trees(cases, program, gains), instants.tolist())
        return outputs, with_ranges_ahead(signals, kernel.behind)

    def gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode = "forward"
    ) -> CostGradient:
        """Outputs of all cases, and the derivative of each case's cost by `gains`.

        Forward mode takes all gains in one pass. Raises `ValueError` for reverse mode.
        """
        if mode != "forward":
            raise ValueError(f'Argument `mode` must be "forward" here, but got "{mode}".')
        _require_floats(gains)
        kernel = self.kernel(program, cases, gains, derivatives=True)
        trees = self.trees(cases, program, gains)
        flat_gradient = kernel.run(trees, program.intervals, self.workers or processors())
        return CostGradient(flat_gradient.outputs, _by_gain(flat_gradient.derivatives, gains))

    def trees(self, cases: PyTree, program: Program, gains: PyTree) -> dict[str, PyTree]:
        """The arguments of a kernel by name."""
        numbers = jax.tree.leaves(numbers_of(self.stepper, program))
        return {"cases": cases, "numbers": numbers, "gains": gains}


def native_obstacle(
    stepper: AbstractStepper,
    program: Program,
    cases: PyTree,
    gains: PyTree = None,
    lanes: int | None = None,
) -> str | None:
    """The reason why the native engine cannot run a program for such cases; None if it can.

    The machine code is compiled for `lanes` lanes, by default chosen for the processor. Any other
    error, above all a `NativeBug`, is raised: it must not cause a fallback.
    """
    obstacle = process_obstacle()
    if obstacle is not None:
        return obstacle
    try:
        _kernel(stepper, program, cases, gains, lanes or target.host().lanes, False)
    except CannotLower as error:
        return str(error)
    return None


def process_obstacle() -> str | None:
    """The reason why the native engine cannot run in this process; None if it can."""
    obstacle = _llvmlite_obstacle()
    if obstacle is None and not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        return NO_64_BITS
    return obstacle


def _llvmlite_obstacle() -> str | None:
    if not target.LLVMLITE:
        return NO_LLVMLITE
    try:
        import llvmlite.binding  # noqa: F401
    except (ImportError, OSError) as error:  # OSError: its library cannot be loaded
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        return f"the compiled engine must have llvmlite, which cannot be imported: {reason}"
    return None


def _kernel(
    stepper: AbstractStepper,
    program: Program,
    cases: PyTree,
    gains: PyTree,
    lanes: int,
    derivatives: bool,
) -> Kernel:
    obstacle = process_obstacle()
    if obstacle is not None:
        raise RuntimeError(obstacle)
    case = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), cases)
    gains = jax.tree.map(lambda x: jax.ShapeDtypeStruct(np.shape(x), np.asarray(x).dtype), gains)
    whole = (stepper, program.of_any_length())
    key = (_kind(whole), _kind(case), _kind(gains), lanes, derivatives)
    with _making(key):
        if key not in _kernels:

            def lowered() -> LoweredTrajectory:
                plain = PrimalPhases(stepper, program)
                phases = ForwardModePhases(plain) if derivatives else plain
                return lower_trajectory(phases, numbers_of(*whole), case, gains, lanes)

            name = entry_name(whole, case, gains, lanes, derivatives)
            _kernels[key] = Kernel(lowered, lanes, name)
        return _kernels[key]


def _by_gain(derivatives: np.ndarray, gains: PyTree) -> PyTree:
    """Derivatives by all numbers of the gains, shaped like the gains after the cases' axis."""
    leaves, structure = jax.tree.flatten(gains)
    shapes = [np.shape(leaf) for leaf in leaves]
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1]
    parts = np.split(derivatives, ends, axis=1)
    arrays = [part.reshape(-1, *shape) for part, shape in zip(parts, shapes, strict=True)]
    return jax.tree.unflatten(structure, arrays)


def _numbers(cases: PyTree, gains: PyTree) -> tuple[PyTree, PyTree]:
    count_of(cases)
    return tuple(
        jax.tree_util.tree_map_with_path(
            lambda path, x, name=name: as_numbers(name + jax.tree_util.keystr(path), x), tree
        )
        for name, tree in (("cases", cases), ("gains", gains))
    )


def _require_floats(gains: PyTree) -> None:
    for path, leaf in jax.tree_util.tree_leaves_with_path(gains):
        name, dtype = "gains" + jax.tree_util.keystr(path), np.asarray(leaf).dtype
        if dtype.kind != "f":
            raise TypeError(f"Argument `{name}` must be floating-point, but got {dtype}.")


def _kind(tree: PyTree) -> tuple:
    """All properties of a tree that a program's structure depends on, without the numbers."""
    arrays, rest = eqx.partition(tree, lambda x: isinstance(x, jax.Array))
    shapes = [(x.shape, x.dtype.name) for x in jax.tree.leaves(arrays)]
    leaves, structure = jax.tree.flatten(rest)
    return tuple(shapes), structure, jax.tree.structure(arrays), tuple(map(_identity, leaves))


def _identity(x: Any) -> Any:
    """Key that distinguishes a leaf: True from 1, 0.0 from -0.0, and arrays by their bytes."""
    if isinstance(x, np.ndarray | np.generic):
        return np.ndarray, x.dtype.str, x.shape, x.tobytes()
    return type(x), x.hex() if isinstance(x, float) else x
