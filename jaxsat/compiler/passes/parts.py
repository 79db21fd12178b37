"""Long loops and switches as functions of their own.

LLVM takes twice as long for a line of a function of 50,000 lines as for one of 10,000.
"""

from collections.abc import Iterator

from jaxsat.compiler import ir

LEAST = 5000
"""Number of steps from which a loop or a switch becomes a function.

Arguments and results go through memory: from 400 steps on, flights would take twice as long.
"""


def with_parts(function: ir.Function) -> None:
    """Replace the long loops and switches of a function, innermost first, by calls.

    What reads or writes a memory stays in its place. Parameters and results are the values
    themselves, so only who prints or interprets a function may follow.
    """
    values = {param.number: param for param in function.params}
    values |= {out.number: out for out in _definitions(function.block)}
    _Parts(function.name, values).replace(function.block)


def _definitions(block: ir.Block) -> Iterator[ir.Value]:
    """The values that a block and those inside define."""
    for step in block.steps:
        yield from ir.definitions(step)
        for inside in ir.blocks_in(step):
            yield from _definitions(inside)


class _Parts:
    """Functions made of steps of a function `name`, whose `values` are given by their numbers."""

    def __init__(self, name: str, values: dict[int, ir.Value]):
        self.name, self.values, self.count = name, values, 0

    def replace(self, block: ir.Block) -> int:
        """Put calls in the place of long steps of a block, and return how many steps are left."""
        size = 0
        for place, step in enumerate(block.steps):
            inner = sum(self.replace(inside) for inside in ir.blocks_in(step))
            if inner >= LEAST and not any(ir.memories(step)):
                block.steps[place], inner = self._call(step), 0
            size += 1 + inner
        return size

    def _call(self, step: ir.Step) -> ir.Call:
        args = [self.values[number] for number in sorted(set(ir.uses(step)))]
        outs = list(ir.definitions(step))
        self.count += 1
        block = ir.Block()
        block.steps = [step]
        function = ir.Function(f"{self.name}.part{self.count}", args, block, list(outs))
        return ir.Call(function, list(args), outs)
