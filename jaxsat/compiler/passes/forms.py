"""Forms of functions: equal for functions whose steps differ in nothing but numbers of values."""

from collections.abc import Sequence
from typing import Any

from jaxsat.compiler import ir


def form_of(function: ir.Function) -> tuple:
    """Return the form of a function that reads no values from outside but its arguments."""
    return _Form().of(function)


class _Form:
    """Numbers of values and memories in the order in which a function names them."""

    def __init__(self):
        self._numbers: dict[int, int] = {}

    def of(self, function: ir.Function) -> tuple:
        params = self._scalars(function.params)
        block = self._block(function.block)
        return params, block, self._scalars(function.results), repr(function.source)

    def _block(self, block: ir.Block) -> tuple:
        return tuple(map(self._step, block.steps))

    def _step(self, step: ir.Step) -> tuple:
        match step:
            case ir.Operation(name=name, args=args, out=out):
                return (name, self._scalars(args), self._scalar(out))
            case ir.Load(memory=memory, index=index, out=out):
                return ("load", self._memory(memory), self._scalars([index, out]))
            case ir.Store(memory=memory, index=index, value=value):
                return ("store", self._memory(memory), self._scalars([index, value]))
            case ir.Call(function=function, args=args, outs=outs):
                return ("call", id(function), self._scalars(args), self._scalars(outs))
            case ir.BlockSwitch(index=index, blocks=blocks, yields=yields, outs=outs):
                parts = [
                    (self._block(block), self._scalars(results))
                    for block, results in zip(blocks, yields, strict=True)
                ]
                names = tuple(step.names.items())
                head = self._scalar(index), step.cold, names
                return ("switch", head, tuple(parts), self._scalars(outs))
            case ir.Loop(params=params, before=before, condition=test, body=body):
                head = self._scalars(before), self._scalars(params)
                tested = self._block(test), self._scalar(step.active)
                return ("loop", head, tested, self._block(body), self._scalars(step.after))

    def _scalars(self, scalars: Sequence[ir.Scalar]) -> tuple:
        return tuple(map(self._scalar, scalars))

    def _scalar(self, x: ir.Scalar) -> Any:
        if isinstance(x, ir.Value):
            return (x.dtype.char, x.uniform, self._number(x.number))
        return (x.dtype.char, x.tobytes())

    def _memory(self, memory: ir.Memory) -> tuple:
        initial = None if memory.initial is None else memory.initial.tobytes()
        kind = memory.dtype.char, memory.size, memory.uniform, initial
        return (*kind, self._scalars(memory.elements), self._number(memory.number))

    def _number(self, number: int) -> int:
        return self._numbers.setdefault(number, len(self._numbers))
