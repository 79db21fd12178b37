"""Dead-code elimination: steps whose results nobody uses, and results of switches and calls."""

from dataclasses import dataclass, field
from itertools import compress

from jaxsat.engine.native.ir import (
    Block,
    Call,
    Function,
    Load,
    Loop,
    Operation,
    Step,
    Store,
    Switch,
    Value,
)


@dataclass
class DeadCodeElimination:
    """Removes what nobody uses; `used` holds the numbers of live values and memories."""

    used: set[int] = field(default_factory=set)

    def need(self, scalars) -> None:
        """Mark values as used."""
        self.used.update(s.number for s in scalars if isinstance(s, Value))

    def block(self, block: Block) -> None:
        """Remove the dead code of a block whose own results are marked already."""
        kept: list[Step] = []
        for step in reversed(block.steps):
            if self._wanted(step):
                self._mark(step)
                kept.append(step)
        block.steps = kept[::-1]

    def _wanted(self, step: Step) -> bool:
        match step:
            case Operation(out=out) | Load(out=out):
                return out.number in self.used
            case Store(memory=memory):
                return memory.number in self.used
            case Loop(params=outs, body=body):
                return self._stores(body) or any(out.number in self.used for out in outs)
            case Switch(outs=outs, blocks=blocks):
                stores = any(map(self._stores, blocks))
                return stores or any(out.number in self.used for out in outs)
            case Call(outs=outs):
                return any(out.number in self.used for out in outs)

    def _stores(self, block: Block) -> bool:
        for step in block.steps:
            match step:
                case Store(memory=memory) if memory.number in self.used:
                    return True
                case Loop(body=body) if self._stores(body):
                    return True
                case Switch(blocks=blocks) if any(map(self._stores, blocks)):
                    return True
        return False

    def _mark(self, step: Step) -> None:
        match step:
            case Operation(args=args):
                self.need(args)
            case Call():
                self.need(step.args)
                used = [out.number in self.used for out in step.outs]
                if step.function.parts and sum(used) == 1:
                    step.function = step.function.parts[used.index(True)]
                    step.outs = list(compress(step.outs, used))
            case Load(memory=memory, index=index):
                self.used.add(memory.number)
                self.need([index, *memory.elements])
            case Store(index=index, value=value):
                self.need([index, value])
            case Switch():
                used = [out.number in self.used for out in step.outs]
                step.outs = list(compress(step.outs, used))
                step.yields = [list(compress(results, used)) for results in step.yields]
                for block, results in zip(step.blocks, step.yields, strict=True):
                    self.need(results)
                    self.block(block)
                self.need([step.index])
            case Loop():
                self.need([*step.after, *step.before, step.active, *step.params])
                self.block(step.body)
                self.block(step.condition)


def without_dead_code(function: Function) -> Function:
    """The function without its dead code."""
    elimination = DeadCodeElimination()
    elimination.need(function.results)
    elimination.block(function.block)
    return function
