"""Dead-code elimination: steps whose results nobody uses, results of switches and calls, and
carries of loops on which nothing depends but themselves.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import compress

from jaxsat.compiler import ir


class DeadCodeElimination:
    """Removal of steps that the results of a block do not depend on.

    `live`: numbers of the values and memories on which the results depend.
    """

    def __init__(self, block: ir.Block, results: Sequence[ir.Scalar]):
        self.live = reachable(dependencies(block), ir.numbers_of(results))
        self._clean(block)

    def _clean(self, block: ir.Block) -> None:
        block.steps = [step for step in block.steps if self._keep(step)]

    def _keep(self, step: ir.Step) -> bool:
        """Whether a step is live, after removing dead parts inside it."""
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
    return any(
        isinstance(step, ir.Store) or any(map(_stores, ir.blocks_in(step))) for step in block.steps
    )


def without_dead_code(function: ir.Function) -> ir.Function:
    """Remove dead code from `function` in place and return it."""
    DeadCodeElimination(function.block, function.results)
    return function


def dependencies(block: ir.Block) -> dict[int, list[int]]:
    """Direct dependencies of each value and memory of a block, by numbers.

    A call depends on all its arguments, a store also on the conditions around it.
    """
    needs: dict[int, list[int]] = defaultdict(list)
    _gather(needs, block, [])
    return needs


def _gather(needs: dict[int, list[int]], block: ir.Block, control: list[int]) -> None:
    """Add dependencies inside a block to `needs`; `control`: conditions around it."""
    for step in block.steps:
        match step:
            case ir.Operation(out=out, args=args):
                needs[out.number] += ir.numbers_of(args)
            case ir.Call(outs=outs, args=args):
                for out in outs:
                    needs[out.number] += ir.numbers_of(args)
            case ir.Load(memory=memory, index=index, out=out):
                needs[out.number] += [memory.number, *ir.numbers_of([index])]
                needs[out.number] += ir.numbers_of(memory.elements)
            case ir.Store(memory=memory, index=index, value=value):
                needs[memory.number] += [*ir.numbers_of([index, value]), *control]
            case ir.BlockSwitch():
                inner = [*control, *ir.numbers_of([step.index])]
                for inside, results in zip(step.blocks, step.yields, strict=True):
                    _gather(needs, inside, inner)
                    for out, result in zip(step.outs, results, strict=True):
                        needs[out.number] += ir.numbers_of([result, step.index])
            case ir.Loop():
                inner = [*control, *ir.numbers_of([step.active])]
                _gather(needs, step.condition, inner)
                _gather(needs, step.body, inner)
                for one in zip(step.params, step.before, step.after, strict=True):
                    needs[one[0].number] += ir.numbers_of([*one[1:], step.active])


def reachable(needs: Mapping[int, list[int]], numbers: Iterable[int]) -> set[int]:
    """Numbers of values and memories, and of all their dependencies."""
    live: set[int] = set()
    waiting = list(numbers)
    while waiting:
        number = waiting.pop()
        if number not in live:
            live.add(number)
            waiting += needs.get(number, ())
    return live
