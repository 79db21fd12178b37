"""Dead-code elimination: steps whose results nobody uses, results of switches and calls, and
carries of loops on which nothing depends but themselves."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import compress

from jaxsat.compiler.ir import (
    Block,
    Call,
    Function,
    Load,
    Loop,
    Operation,
    Scalar,
    Step,
    Store,
    Switch,
    Value,
)


class DeadCodeElimination:
    """Removes from a block what its results do not depend on.

    `live` holds the numbers of the values and memories that they do depend on.
    """

    def __init__(self, block: Block, results: Sequence[Scalar]):
        self._needs: dict[int, list[int]] = defaultdict(list)
        self._gather(block, [])
        self.live: set[int] = set()
        waiting = _numbers(results)
        while waiting:
            number = waiting.pop()
            if number not in self.live:
                self.live.add(number)
                waiting += self._needs[number]
        self._clean(block)

    def _gather(self, block: Block, control: list[int]) -> None:
        """Note what values and memories need; `control` are the conditions around the block."""
        for step in block.steps:
            match step:
                case Operation(out=out, args=args):
                    self._needs[out.number] += _numbers(args)
                case Call(outs=outs, args=args):
                    for out in outs:
                        self._needs[out.number] += _numbers(args)
                case Load(memory=memory, index=index, out=out):
                    self._needs[out.number] += [memory.number, *_numbers([index])]
                    self._needs[out.number] += _numbers(memory.elements)
                case Store(memory=memory, index=index, value=value):
                    self._needs[memory.number] += [*_numbers([index, value]), *control]
                case Switch():
                    inner = [*control, *_numbers([step.index])]
                    for inside, results in zip(step.blocks, step.yields, strict=True):
                        self._gather(inside, inner)
                        for out, result in zip(step.outs, results, strict=True):
                            self._needs[out.number] += _numbers([result, step.index])
                case Loop():
                    inner = [*control, *_numbers([step.active])]
                    self._gather(step.condition, inner)
                    self._gather(step.body, inner)
                    for one in zip(step.params, step.before, step.after, strict=True):
                        self._needs[one[0].number] += _numbers([*one[1:], step.active])

    def _clean(self, block: Block) -> None:
        """Remove the dead code of a block and of those inside."""
        block.steps = [step for step in block.steps if self._kept(step)]

    def _kept(self, step: Step) -> bool:
        """Whether a step is wanted, which then is without its own dead parts."""
        match step:
            case Operation(out=out) | Load(out=out):
                return out.number in self.live
            case Store(memory=memory):
                return memory.number in self.live
            case Call(outs=outs):
                used = self._used(outs)
                if step.function.parts and sum(used) == 1:
                    step.function = step.function.parts[used.index(True)]
                    step.outs = list(compress(outs, used))
                return any(used)
            case Switch():
                used = self._used(step.outs)
                step.outs = list(compress(step.outs, used))
                step.yields = [list(compress(results, used)) for results in step.yields]
                for inside in step.blocks:
                    self._clean(inside)
                return bool(step.outs) or any(map(_stores, step.blocks))
            case Loop():
                used = self._used(step.params)
                step.params = list(compress(step.params, used))
                step.before = list(compress(step.before, used))
                step.after = list(compress(step.after, used))
                self._clean(step.condition)
                self._clean(step.body)
                return bool(step.params) or _stores(step.body)

    def _used(self, outs: Sequence[Value]) -> list[bool]:
        return [out.number in self.live for out in outs]


def _numbers(scalars: Sequence[Scalar]) -> list[int]:
    return [x.number for x in scalars if isinstance(x, Value)]


def _stores(block: Block) -> bool:
    """Whether a block without dead code stores anything."""
    for step in block.steps:
        match step:
            case Store():
                return True
            case Loop(body=body) if _stores(body):
                return True
            case Switch(blocks=blocks) if any(map(_stores, blocks)):
                return True
    return False


def without_dead_code(function: Function) -> Function:
    """The function without its dead code."""
    DeadCodeElimination(function.block, function.results)
    return function
