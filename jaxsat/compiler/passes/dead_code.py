"""Dead-code elimination: steps whose results nobody uses, results of switches and calls, and
carries of loops on which nothing depends but themselves.

`dependencies` says which inputs every result needs: data flow forward, by bits of whole numbers.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import compress

from jaxsat.compiler import ir


class DeadCodeElimination:
    """Removes from a block what its results do not depend on.

    `live` holds the numbers of the values and memories that they do depend on.
    """

    def __init__(self, block: ir.Block, results: Sequence[ir.Scalar]):
        self._needs: dict[int, list[int]] = defaultdict(list)
        self._gather(block, [])
        self.live: set[int] = set()
        waiting = ir.numbers_of(results)
        while waiting:
            number = waiting.pop()
            if number not in self.live:
                self.live.add(number)
                waiting += self._needs[number]
        self._clean(block)

    def _gather(self, block: ir.Block, control: list[int]) -> None:
        """Note what values and memories need; `control` are the conditions around the block."""
        for step in block.steps:
            match step:
                case ir.Operation(out=out, args=args):
                    self._needs[out.number] += ir.numbers_of(args)
                case ir.Call(outs=outs, args=args):
                    for out in outs:
                        self._needs[out.number] += ir.numbers_of(args)
                case ir.Load(memory=memory, index=index, out=out):
                    self._needs[out.number] += [memory.number, *ir.numbers_of([index])]
                    self._needs[out.number] += ir.numbers_of(memory.elements)
                case ir.Store(memory=memory, index=index, value=value):
                    self._needs[memory.number] += [*ir.numbers_of([index, value]), *control]
                case ir.BlockSwitch():
                    inner = [*control, *ir.numbers_of([step.index])]
                    for inside, results in zip(step.blocks, step.yields, strict=True):
                        self._gather(inside, inner)
                        for out, result in zip(step.outs, results, strict=True):
                            self._needs[out.number] += ir.numbers_of([result, step.index])
                case ir.Loop():
                    inner = [*control, *ir.numbers_of([step.active])]
                    self._gather(step.condition, inner)
                    self._gather(step.body, inner)
                    for one in zip(step.params, step.before, step.after, strict=True):
                        self._needs[one[0].number] += ir.numbers_of([*one[1:], step.active])

    def _clean(self, block: ir.Block) -> None:
        """Remove the dead code of a block and of those inside."""
        block.steps = [step for step in block.steps if self._keep(step)]

    def _keep(self, step: ir.Step) -> bool:
        """Whether a step is wanted, which then is without its own dead parts."""
        match step:
            case ir.Operation(out=out) | ir.Load(out=out):
                return out.number in self.live
            case ir.Store(memory=memory):
                return memory.number in self.live
            case ir.Call(outs=outs):
                live = self._liveness(outs)
                if step.function.parts and sum(live) == 1:
                    step.function = step.function.parts[live.index(True)]
                    step.outs = list(compress(outs, live))
                return any(live)
            case ir.BlockSwitch():
                live = self._liveness(step.outs)
                step.outs = list(compress(step.outs, live))
                step.yields = [list(compress(results, live)) for results in step.yields]
                for inside in step.blocks:
                    self._clean(inside)
                return bool(step.outs) or any(map(_stores, step.blocks))
            case ir.Loop():
                live = self._liveness(step.params)
                step.params = list(compress(step.params, live))
                step.before = list(compress(step.before, live))
                step.after = list(compress(step.after, live))
                self._clean(step.condition)
                self._clean(step.body)
                return bool(step.params) or _stores(step.body)

    def _liveness(self, outs: Sequence[ir.Value]) -> list[bool]:
        return [out.number in self.live for out in outs]


def _stores(block: ir.Block) -> bool:
    """Whether a block without dead code stores anything."""
    return any(
        isinstance(step, ir.Store) or any(map(_stores, ir.blocks_in(step))) for step in block.steps
    )


def without_dead_code(function: ir.Function) -> ir.Function:
    """The function without its dead code."""
    DeadCodeElimination(function.block, function.results)
    return function


def dependencies(function: ir.Function) -> list[frozenset[int]]:
    """For every result, the numbers of the parameters that it may need.

    Results of equal needs have the same set. A call needs all its arguments.
    """
    flow = _DataFlow({param.number: 1 << i for i, param in enumerate(function.params)})
    flow.block(function.block, 0)
    needs = [flow.of([x]) for x in function.results]
    numbers = {need: frozenset(_bits(need)) for need in set(needs)}
    return [numbers[need] for need in needs]


def _bits(number: int) -> Iterator[int]:
    """The bits of a whole number that are one."""
    while number:
        lowest = number & -number
        yield lowest.bit_length() - 1
        number ^= lowest


@dataclass
class _DataFlow:
    """What values and memories need, by their numbers; bit i stands for parameter i."""

    values: dict[int, int]
    memories: dict[int, int] = field(default_factory=dict)

    def of(self, scalars: Iterable[ir.Scalar]) -> int:
        """What any of them needs."""
        needs = 0
        for x in scalars:
            if isinstance(x, ir.Value):
                needs |= self.values.get(x.number, 0)
        return needs

    def block(self, block: ir.Block, control: int) -> None:
        """Go through a block; whether it runs depends on `control`."""
        for step in block.steps:
            self._step(step, control)

    def _step(self, step: ir.Step, control: int) -> None:
        match step:
            case ir.Operation(args=args, out=out):
                self.values[out.number] = self.of(args)
            case ir.Load(memory=memory, index=index, out=out):
                self._note([out], [self.of([index, *memory.elements]) | self._in(memory)])
            case ir.Store(memory=memory, index=index, value=value):
                needs = self._in(memory) | self.of([index, value]) | control
                self.memories[memory.number] = needs
            case ir.Call(args=args, outs=outs):
                self._note(outs, [self.of(args)] * len(outs))
            case ir.BlockSwitch():
                control |= self.of([step.index])
                for block in step.blocks:
                    self.block(block, control)
                yields = zip(*step.yields, strict=True)
                self._note(step.outs, [self.of(several) | control for several in yields])
            case ir.Loop():
                self._loop(step, control)

    def _loop(self, loop: ir.Loop, control: int) -> None:
        """Go through a loop until nothing changes.

        What a parameter needs, others may need in the next turn. What was found in the turn before
        of a loop around this one is needed for certain.
        """
        after = [self.of([x, y]) for x, y in zip(loop.before, loop.params, strict=True)]
        memories = dict(self.memories)
        while True:
            self._note(loop.params, after)
            self.block(loop.condition, control)
            test = control | self.of([loop.active])
            self.block(loop.body, test)
            before, memories_before = after, memories
            after = [self.of([x, y]) | test for x, y in zip(loop.params, loop.after, strict=True)]
            memories = dict(self.memories)
            if (after, memories) == (before, memories_before):
                return

    def _note(self, values: Sequence[ir.Value], needs: Sequence[int]) -> None:
        self.values.update((x.number, need) for x, need in zip(values, needs, strict=True))

    def _in(self, memory: ir.Memory) -> int:
        return self.memories.get(memory.number, 0)
