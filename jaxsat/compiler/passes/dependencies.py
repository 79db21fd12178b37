"""Which inputs a function's results need: data flow forward, by bits of whole numbers."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from jaxsat.compiler.ir import (
    Block,
    Call,
    Function,
    Load,
    Loop,
    Memory,
    Operation,
    Scalar,
    Step,
    Store,
    Switch,
    Value,
)


def dependencies(function: Function) -> list[set[int]]:
    """For every result, the numbers of the parameters that it may need.

    A call needs all its arguments.
    """
    flow = _DataFlow({param.number: 1 << i for i, param in enumerate(function.params)})
    flow.block(function.block, 0)
    indices = range(len(function.params))
    needs = [flow.of([x]) for x in function.results]
    return [{i for i in indices if need >> i & 1} for need in needs]


@dataclass
class _DataFlow:
    """What values and memories need, by their numbers; bit i stands for parameter i."""

    known: dict[int, int]
    memories: dict[int, int] = field(default_factory=dict)

    def of(self, scalars: Iterable[Scalar]) -> int:
        """What any of them needs."""
        found = 0
        for x in scalars:
            if isinstance(x, Value):
                found |= self.known.get(x.number, 0)
        return found

    def block(self, block: Block, control: int) -> None:
        """Go through a block; whether it runs depends on `control`."""
        for step in block.steps:
            self._step(step, control)

    def _step(self, step: Step, control: int) -> None:
        match step:
            case Operation(args=args, out=out):
                self._note([out], [self.of(args)])
            case Load(memory=memory, index=index, out=out):
                self._note([out], [self.of([index, *memory.elements]) | self._in(memory)])
            case Store(memory=memory, index=index, value=value):
                needs = self._in(memory) | self.of([index, value]) | control
                self.memories[memory.number] = needs
            case Call(args=args, outs=outs):
                self._note(outs, [self.of(args)] * len(outs))
            case Switch():
                control |= self.of([step.index])
                for block in step.blocks:
                    self.block(block, control)
                yields = zip(*step.yields, strict=True)
                self._note(step.outs, [self.of(several) | control for several in yields])
            case Loop():
                self._loop(step, control)

    def _loop(self, loop: Loop, control: int) -> None:
        """Until nothing changes: what a parameter needs, others may need in the next turn."""
        after, memories = [self.of([x]) for x in loop.before], dict(self.memories)
        while True:
            self._note(loop.params, after)
            self.block(loop.condition, control)
            test = control | self.of([loop.active])
            self.block(loop.body, test)
            before, seen = after, memories
            after = [self.of([x, y]) | test for x, y in zip(loop.params, loop.after, strict=True)]
            memories = dict(self.memories)
            if (after, memories) == (before, seen):
                return

    def _note(self, values: Sequence[Value], needs: Sequence[int]) -> None:
        self.known.update((x.number, need) for x, need in zip(values, needs, strict=True))

    def _in(self, memory: Memory) -> int:
        return self.memories.get(memory.number, 0)
