"""Builder of programs, operation by operation: folds constants, shares equal operations.

The rules that lower primitives use this class alone.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.operations import BOOL, INT, OPERATIONS, evaluate
from jaxsat.compiler.passes.branching import are_cheap
from jaxsat.compiler.passes.counting import ranges_in
from jaxsat.compiler.passes.ranges import Ranges
from jaxsat.compiler.passes.simplify import Predicates, identity, simplified
from jaxsat.compiler.trace import Frame, Trace


class Builder:
    """Appends to one block; `mask` (a varying bool or None) marks the lanes that need the block."""

    def __init__(self, like: "Builder | None" = None):
        """Begin a program, or a function that the program of the builder `like` calls."""
        self.block = ir.Block()
        self.compact = like is not None and like.compact  # functions are called, never written out
        self.trace: Trace | None = None if like is None else like.trace
        self.mask: ir.Scalar | None = None
        self.outside: dict[int, list[ir.Value]] = {}  # arrays from outside, by their first value
        self.parameters: set[int] = set()  # arguments of the function in a compact program
        self.functions: dict[tuple, ir.Function] = {}
        self.repeated: dict[int, Any] = {}
        self.outlined: dict[int, Any] = {}  # jaxprs of Python functions, by identity
        self.variants: dict[tuple, Any] = {}  # functions made of these, and loops, by their kinds
        self.cutter: Callable | None = None
        self.kept: list[Any] = []  # the objects that these identities belong to
        if like is not None:
            self.functions, self.repeated = like.functions, like.repeated
            self.outlined, self.variants, self.kept = like.outlined, like.variants, like.kept
            self.cutter = like.cutter
        self.ranges = Ranges() if like is None else like.ranges
        self.predicates = Predicates()
        self._negated: dict[int, ir.Scalar] = {}  # what a value is the negative of
        # of products in a compact program
        self.factors: dict[int, tuple[ir.Scalar, ir.Scalar]] = {}
        self.truths: dict[int, ir.Scalar] = {}  # the predicates of numbers made of them: 0 or 1
        self.written = 0  # operations so far

    def operation(self, name: str, *args: ir.Scalar, dtype: np.dtype | None = None) -> ir.Scalar:
        """Append an arithmetic operation; `dtype` is the result's where operands leave it open."""
        if dtype is None:
            compares = name == "any" or (name in OPERATIONS and OPERATIONS[name].compares)
            dtype = BOOL if compares else args[-1].dtype
        if self.compact:
            args = tuple(map(self.block.decided, args))
        constant = uniform = True
        for arg in args:
            if isinstance(arg, ir.Value):
                constant, uniform = False, uniform and arg.uniform
        if constant:
            return dtype.type(np.asarray(evaluate(name, args, dtype)).astype(dtype)[()])
        if self.compact:  # elsewhere, how often a product is read decides whether it is fused
            args = self.predicates.parts(name, args)
        simple = simplified(name, args, dtype)
        if simple is None:
            simple = self.ranges.simplified(name, args)
        if simple is None:
            simple = self.predicates.simplified(name, args)
        if simple is None and self.compact and name in ("eq", "ne"):
            simple = self._as_predicate(name, *args)
        if simple is None and dtype.kind == "f":
            simple = self._with_sign_outside(name, args)
        if simple is not None:
            return simple
        key = (name, dtype.char, *map(identity, args))
        value = self.block.find(key)
        if value is None:
            value = ir.Value(dtype, uniform or name == "any")
            self.block.steps.append(ir.Operation(name, args, value))
            self._note(value)
            self.written += 1
            self.block.values[key] = value
            if name == "neg":
                self._negated[value.number] = args[0]
            if name == "mul" and self.compact:
                self.factors[value.number] = (args[0], args[1])
            self.ranges.note_result(name, args, value)
            self.predicates.note(name, args, value)
            if name == "convert" or (name == "bitcast" and args[0].dtype.kind != "f"):
                self.ranges.note_converted(args[0], value)
            if name == "convert":
                self._note_truth(args[0], value)
        return value

    def _note_truth(self, source: ir.Scalar, value: ir.Value) -> None:
        """Note the predicate of a number that is made of it, 0 or 1, or of such a number."""
        if source.dtype == BOOL:
            self.truths[value.number] = source
        elif isinstance(source, ir.Value) and source.number in self.truths:
            self.truths[value.number] = self.truths[source.number]

    def _as_predicate(self, name: str, x: ir.Scalar, number: ir.Scalar) -> ir.Scalar | None:
        """Return the predicate that an equality of a truth value, or of a choice with a part that
        alone is a constant, and this constant is; or None."""
        if not isinstance(x, ir.Value) or isinstance(number, ir.Value) or number.dtype.kind != "i":
            return None
        truth = self.truths.get(x.number)
        ones = x.dtype.type(1), x.dtype.type(0)
        selection = self.predicates.selection(x) if truth is None else (truth, *ones)
        if selection is None:
            return None
        predicate, *parts = selection
        equal = [
            self.ranges.simplified("eq", (part, number))
            if isinstance(part, ir.Value)
            else part == number
            for part in parts
        ]
        if None in equal or equal[0] == equal[1]:
            return None
        return predicate if equal[0] == (name == "eq") else self.negation(predicate)

    def _with_sign_outside(self, name: str, args: Sequence[ir.Scalar]) -> ir.Scalar | None:
        """Return an equal value, in all bits, with a negation absorbed or passed on, or None."""
        inner = [self._negated.get(x.number) if isinstance(x, ir.Value) else None for x in args]
        if not any(x is not None for x in inner):
            return None
        match name, args, inner:
            case "neg", _, [x] if x is not None:
                return x
            case "add", [x, _], [_, y] if y is not None:
                return self.operation("sub", x, y)
            case "add", [_, y], [x, _] if x is not None:
                return self.operation("sub", y, x)
            case "sub", [x, _], [_, y] if y is not None:
                return self.operation("add", x, y)
            case "mul" | "div", [x, y], [a, b] if a is not None or b is not None:
                whole = self.operation(name, x if a is None else a, y if b is None else b)
                return whole if a is not None and b is not None else self.operation("neg", whole)
        return None

    def select(self, predicate: ir.Scalar, yes: ir.Scalar, no: ir.Scalar) -> ir.Scalar:
        """Return `yes` where the predicate holds, else `no`."""
        return self.operation("select", predicate, yes, no)

    def convert(self, x: ir.Scalar, dtype: np.dtype) -> ir.Scalar:
        """Return `x` as a number of another type."""
        return x if x.dtype == dtype else self.operation("convert", x, dtype=dtype)

    def any(self, predicate: ir.Scalar) -> ir.Scalar:
        """Return whether a predicate holds in any lane."""
        return predicate if ir.is_uniform(predicate) else self.operation("any", predicate)

    def negation(self, predicate: ir.Scalar) -> ir.Scalar:
        """Return the negation of a predicate."""
        return self.operation("xor", predicate, np.True_)

    def load(self, memory: ir.Memory, index: ir.Scalar) -> ir.Scalar:
        """Load an element of a memory after its last write."""
        key = ("load", memory.number, identity(index))
        value = self.block.find(key)
        if value is None:
            value = ir.Value(memory.dtype, memory.uniform and ir.is_uniform(index))
            self.block.steps.append(ir.Load(memory, index, value))
            if memory.initial is not None and memory.dtype.kind in "iu":
                self.ranges.note(value, int(memory.initial.min()), int(memory.initial.max()))
            self._note(value)
            self.block.values[key] = value
        return value

    def store(self, memory: ir.Memory, index: ir.Scalar, value: ir.Scalar) -> None:
        """Store a value at an element of a memory."""
        self.block.steps.append(ir.Store(memory, index, value))
        self.written += 1

    def at(self, frames: tuple[Frame, ...]):
        """Within this context, values have these source frames, if a trace is kept."""
        return nullcontext() if self.trace is None else self.trace.at(frames)

    @contextmanager
    def inside(self, block: ir.Block, mask: ir.Scalar | None):
        """Within this context, append to another block; lanes outside `mask` do not matter."""
        before = self.block, self.mask
        self.block, self.mask = block, mask
        try:
            yield
        finally:
            self.block, self.mask = before

    def while_loop(
        self,
        before: Sequence[ir.Scalar],
        uniform: Sequence[bool],
        condition: Callable[[list[ir.Scalar]], ir.Scalar],
        body: Callable[[list[ir.Scalar]], list[ir.Scalar]],
        varying: bool,
    ) -> list[ir.Scalar]:
        """Append a loop of scalars that are `uniform` or not, with a `varying` condition or not.

        Raises `AssertionError` where the body makes a uniform scalar varying.
        """
        params = [ir.Value(x.dtype, u) for x, u in zip(before, uniform, strict=True)]
        written = self.written
        step = self._loop(params, before, condition, body, varying)
        if self.compact and (ranges := ranges_in(step, self.ranges)):
            self.written = written  # once more, with what is known now
            for place, (_, after) in ranges.items():
                self.ranges.note(params[place], *after)
            inside = {params[place]: within for place, (within, _) in ranges.items()}
            step = self._loop(params, before, condition, body, varying, inside)
            for place, (_, after) in ranges.items():
                self.ranges.note(params[place], *after)
        if not isinstance(step.active, ir.Value) and not step.active:  # what is around decides it
            self.written = written
            return list(before)
        self._note(*params)
        for value, param in zip(step.after, params, strict=True):
            assert ir.is_uniform(value) or not param.uniform, "a uniform carry became varying"
            assert value.dtype == param.dtype, f"{param} became {value.dtype}"
        self.block.steps.append(step)
        return list(params)

    def _loop(
        self,
        params: list[ir.Value],
        before: Sequence[ir.Scalar],
        condition: Callable[[list[ir.Scalar]], ir.Scalar],
        body: Callable[[list[ir.Scalar]], list[ir.Scalar]],
        varying: bool,
        ranges: Mapping[ir.Value, tuple[int, int]] | None = None,
    ) -> ir.Loop:
        """Return a loop; `ranges` are those of params in the body."""
        test, work = ir.Block(self.block), ir.Block(self.block)
        with self.inside(test, self.mask):
            active = condition(list(params))
            if varying and self.mask is not None:
                active = self.operation("and", active, self.mask)
        work.outer = test
        if self.compact:
            work.outcomes = self.predicates.tested(active, params, before)
        for param, bounds in (ranges or {}).items():
            self.ranges.note(param, *bounds)
        with self.inside(work, self.mask if ir.is_uniform(active) else active):
            after = body(list(params))
            if not ir.is_uniform(active):
                after = [self.select(active, a, p) for a, p in zip(after, params, strict=True)]
        return ir.Loop(params, list(before), test, active, work, after)

    def switch(
        self, index: ir.Scalar, branches: Sequence[Callable[[], list[ir.Scalar]]]
    ) -> list[ir.Scalar]:
        """Return the results of the branch number `index`, which is in range."""
        if not isinstance(index, ir.Value):
            return branches[int(index)]()
        masks = None
        if not index.uniform:
            masks = [self.operation("eq", index, index.dtype.type(i)) for i in range(len(branches))]
            if self.mask is not None:
                masks = [self.operation("and", mask, self.mask) for mask in masks]
        blocks, yields = [], []
        for number, branch in enumerate(branches):
            block = ir.Block(self.block)
            if self.compact and len(branches) == 2 and index.number in self.truths:
                predicate = self.truths[index.number]
                block.outcomes = self.predicates.implied(predicate, holds=number == 1)
            with self.inside(block, masks[number] if masks else self.mask):
                yields.append(branch())
            blocks.append(block)
        if masks is None and not are_cheap(blocks):
            return self._switch(index, blocks, yields)
        return self._everywhere(index, masks, blocks, yields)

    def cold_branch(
        self, predicate: ir.Scalar, cold: Callable[[], ir.Scalar], hot: ir.Scalar
    ) -> ir.Scalar:
        """Return `cold` where the predicate holds; skip the branch if it holds in no lane."""
        if self.mask is not None:
            predicate = self.operation("and", predicate, self.mask)
        if not isinstance(predicate, ir.Value):
            return cold() if predicate else hot
        block = ir.Block(self.block)
        with self.inside(block, predicate):
            result = self.select(predicate, cold(), hot)
        branch = self.convert(self.any(predicate), INT)
        blocks = [ir.Block(self.block), block]
        return self._switch(branch, blocks, [[hot], [result]], cold=True)[0]

    def loop(
        self,
        kind: str,
        args: Sequence[ir.Scalar],
        shapes: Sequence[tuple[int, ...]],
        out: tuple[tuple[int, ...], np.dtype],
        axes: tuple[int, int] = (0, 0),
    ) -> list[ir.Scalar]:
        """Call an operation on arrays that is written as a loop (see `Source`)."""
        shape, dtype = out
        key = (kind, *shapes, shape, args[0].dtype.char, dtype.char, axes)
        if key not in self.variants:
            params = [ir.Value(arg.dtype, True) for arg in args]
            results: list[ir.Scalar] = [ir.Value(dtype, True) for _ in range(int(np.prod(shape)))]
            source = ir.Source(kind, "", shapes, [shape], kind, axes)
            label = f"{kind}.{len(self.variants)}"
            self.variants[key] = ir.Function(label, params, ir.Block(), results, source=source)
        outs = self.call(self.variants[key], args)
        if kind in ("argmin", "argmax"):
            self.ranges.note(outs[0], 0, len(args) - 1)  # pyright: ignore
        return outs

    def call(
        self,
        function: ir.Function,
        args: Sequence[ir.Scalar],
        bounds: Sequence[tuple[int, int] | None] | None = None,
    ) -> list[ir.Scalar]:
        """Return the results of a function for these arguments.

        `bounds` are the known ranges of its results, by default those where it was lowered.
        """
        key = ("call", function.name, *map(identity, args))
        cached = self.block.find(key)
        if cached is not None:
            return list(cached)  # pyright: ignore[reportArgumentType]
        outs = [ir.Value(result.dtype, ir.is_uniform(result)) for result in function.results]
        self.block.steps.append(ir.Call(function, list(args), outs))
        if bounds is None:
            bounds = [self.ranges.of(x) for x in function.results]
        for out, limits in zip(outs, bounds, strict=True):
            if limits is not None:
                self.ranges.note(out, *limits)
        self._note(*outs)
        self.block.values[key] = outs  # pyright: ignore[reportArgumentType]
        return list(outs)

    def cut(self, jaxpr: Any) -> Any:
        """Return a program as it is lowered: cut into functions where a cutter is set."""
        if self.cutter is None:
            return jaxpr
        program, outline = self.cutter(jaxpr)
        self.outlined |= outline.functions
        assert self.trace is not None
        self.trace.calls |= outline.frames
        self.kept += [program, outline]
        return program

    def _note(self, *values: ir.Value) -> None:
        if self.trace is not None:
            self.trace.places.update((value.number, self.trace.now) for value in values)

    def _switch(self, index, blocks, yields, *, cold: bool = False) -> list[ir.Scalar]:
        kinds = zip(*yields, strict=True)
        outs = [ir.Value(several[0].dtype, all(map(ir.is_uniform, several))) for several in kinds]
        self.block.steps.append(ir.BlockSwitch(index, blocks, yields, outs, cold))
        for out, several in zip(outs, zip(*yields, strict=True), strict=True):
            self.ranges.note_among(out, several)
        self._note(*outs)
        return list(outs)

    def _everywhere(self, index, masks, blocks, yields) -> list[ir.Scalar]:
        """Run cheap branches in all lanes, others where a lane needs them."""
        whole = are_cheap(blocks)
        values: list[ir.Scalar] | None = None
        dear = []
        for number in reversed(range(len(blocks))):
            block, results = blocks[number], yields[number]
            if not (whole or are_cheap([block])):
                dear.append(number)
                continue
            self.block.steps += block.steps
            self.block.values |= block.values
            if values is None:
                values = list(results)
            else:
                here = self.operation("eq", index, index.dtype.type(number))
                values = [self.select(here, a, b) for a, b in zip(results, values, strict=True)]
        for number in reversed(dear):
            block, results, mask = blocks[number], yields[number], masks[number]
            if values is None:
                values = [result.dtype.type(0) for result in results]
            with self.inside(block, mask):
                merged = [self.select(mask, a, b) for a, b in zip(results, values, strict=True)]
            branch = self.convert(self.any(mask), INT)
            values = self._switch(branch, [ir.Block(self.block), block], [values, merged])
        assert values is not None
        return values
