"""Any function of one case, compiled for many."""

import threading
from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler import rules
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.interpreter import interpret
from jaxsat.compiler.ir import Function, Value
from jaxsat.compiler.llvm import cache, target
from jaxsat.compiler.llvm.arguments import AlignedMemory, Arguments, addresses
from jaxsat.compiler.llvm.drivers import RUN, run_blocks
from jaxsat.compiler.llvm.emitter import Module, require_lanes
from jaxsat.compiler.llvm.entry_points import EntryPoint, emit_entry_point
from jaxsat.compiler.llvm.locations import Location, PerCase, SharedElement
from jaxsat.compiler.llvm.threads import in_own_thread
from jaxsat.compiler.lowering import CannotLower, arrays_of, lower, number_type, scalars_of
from jaxsat.core.jaxprs import Jaxpr, jaxpr_and_shapes
from jaxsat.core.once import once_property

del rules  # imported for the table it fills


class Mapped:
    """A function of one case and of shared data, mapped over the leading axis of cases.

    `function(case, shared)` is written for one case and may be anything of `jax.numpy` that the
    compiled engine supports; `case` and `shared` are examples, for their shapes and types. Raises
    `CannotLower` for unsupported operations, and `ValueError` for a number of `lanes` other than 1,
    2, 4, 8 and 16. `cpu` is the target processor, by default this one. Without `contract` no
    product and sum become one operation: every processor gives the same bits. Code for this
    processor is `kept` on disk for other processes on request.
    """

    def __init__(
        self,
        function: Callable,
        case: PyTree,
        shared: PyTree = None,
        lanes: int = 0,
        cpu: target.Host | None = None,
        contract: bool = True,
        kept: bool = False,
    ):
        self.cpu, self._contract, self._kept = cpu or target.host(), contract, kept
        self.lanes = lanes or self.cpu.lanes
        require_lanes(self.lanes)
        self.jaxpr, self._shape = jaxpr_and_shapes(function, case, shared)
        trees = {"cases": case, "shared": shared}
        self._arguments = Arguments.of(trees, self.jaxpr.in_avals, "cases")
        self.entry_point = _entry_point(self.jaxpr, len(jax.tree.leaves(case)))

    def __call__(self, cases: PyTree, shared: PyTree = None) -> PyTree:
        """Return the outputs of all cases.

        Raises `ValueError` for arrays of other shapes than those of the examples (after the common
        axis of cases) and trees of another structure, and `TypeError` for numbers of types that
        those of the examples cannot represent.
        """
        inputs, count = self._taken(cases, shared)
        leaves, structure = jax.tree.flatten(self._shape)
        outputs = [np.zeros((count, *leaf.shape), leaf.dtype) for leaf in leaves]
        run = self._run

        def work(stopped: threading.Event) -> None:
            del stopped
            arena = AlignedMemory(self._module.arena)
            run(addresses(arena, [*inputs, *outputs]), None, 0, count, 0, 0)

        in_own_thread(work)
        return jax.tree.unflatten(structure, outputs)

    def interpreted(self, cases: PyTree, shared: PyTree = None) -> PyTree:
        """Return the outputs by the interpreter: all cases as lanes of one vector."""
        inputs, count = self._taken(cases, shared)
        args = []
        for location in self.entry_point.inputs:
            assert isinstance(location, PerCase | SharedElement)
            array = inputs[location.array]
            if isinstance(location, SharedElement):
                args.append(array.reshape(-1)[location.element])
            else:
                args.append(array.reshape(count, -1)[:, location.element])
        results = interpret(self.entry_point.function, args)
        leaves, structure = jax.tree.flatten(self._shape)
        rows = [np.broadcast_to(result, (count,)) for result in results]
        outputs, begin = [], 0
        for leaf in leaves:
            size = int(np.prod(leaf.shape))
            part = np.array(rows[begin : begin + size]).reshape(size, count)
            outputs.append(part.T.reshape(count, *leaf.shape).astype(leaf.dtype))
            begin += size
        return jax.tree.unflatten(structure, outputs)

    @once_property
    def _module(self) -> Module:
        module = Module(self.lanes, self.cpu.masks, self._contract and self.cpu.fuses)
        emit_entry_point(module, self.entry_point)
        module.functions["run"] = run_blocks(self.lanes, [self.entry_point.function.name])
        return module

    @property
    def text(self) -> str:
        """The LLVM code."""
        return self._module.text(self.cpu.attributes())

    def assembly(self) -> str:
        """Return the machine code for this processor, as text."""
        text = self.text
        return in_own_thread(lambda stopped: target.assembly(text, self.cpu))

    @once_property
    def _run(self) -> Callable[..., None]:
        here = target.host()
        if self.cpu.architecture != here.architecture or self.cpu.register > here.register:
            raise RuntimeError(f"This processor ({here.name}) cannot run code for {self.cpu.name}.")
        text = self.text

        def work(stopped: threading.Event) -> Callable[..., None]:
            del stopped
            made_here = self._kept and self.cpu == here
            code = cache.object_code(text) if made_here else target.object_code(text, self.cpu)
            return target.loaded(code, {"run": RUN})["run"]

        return in_own_thread(work)

    def _taken(self, cases: PyTree, shared: PyTree) -> tuple[list[np.ndarray], int]:
        return self._arguments.taken({"cases": cases, "shared": shared})


def compiled_over_cases(
    function: Callable, case: PyTree, shared: PyTree = None, contract: bool = True
) -> Callable[..., PyTree]:
    """Compile `function(case, shared)` over a leading axis of cases, as `Mapped`, with cached code.

    XLA, which takes several times as long, compiles unsupported operations, and everything without
    llvmlite.
    """
    try:
        if target.LLVMLITE:
            return Mapped(function, case, shared, contract=contract, kept=True)
    except CannotLower:
        pass
    mapped = jax.jit(jax.vmap(function, (0, None)))
    return lambda cases, shared=None: jax.tree.map(np.asarray, mapped(cases, shared))


def _entry_point(jaxpr: Jaxpr, per_case: int) -> EntryPoint:
    params: list[Value] = []
    inputs: list[Location] = []
    shapes = [aval.shape for aval in jaxpr.in_avals]
    for array, aval in enumerate(jaxpr.in_avals):
        size = int(np.prod(aval.shape))
        for element in range(size):
            params.append(Value(number_type(aval.dtype), array >= per_case))
            of_case = PerCase(array, element, size)
            inputs.append(of_case if array < per_case else SharedElement(array, element))
    b = Builder()
    results = scalars_of(lower(b, jaxpr, arrays_of(params, shapes)))
    outputs: list[Location] = []
    for array, aval in enumerate(jaxpr.out_avals, len(jaxpr.in_avals)):
        size = int(np.prod(aval.shape))
        outputs += [PerCase(array, element, size) for element in range(size)]
    return EntryPoint(Function("one", params, b.block, results), inputs, outputs).optimised()
