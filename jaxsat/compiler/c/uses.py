"""How often the values of a program are used, and where."""

from collections import Counter
from collections.abc import Iterable, Sequence

from jaxsat.compiler.ir import (
    Block,
    BlockSwitch,
    Call,
    Load,
    Loop,
    Operation,
    Scalar,
    Step,
    Store,
    Value,
    definitions,
)


class Uses:
    """The uses of every value of a block, those in blocks inside it included.

    `makers` are the operations that make values, by the number of the value.
    """

    def __init__(self, block: Block, results: Iterable[Scalar]):
        self.makers: dict[int, Operation] = {}
        self._count: Counter[int] = Counter()
        self._elsewhere: set[int] = set()
        self._block(block, results)

    def is_once(self, value: Value) -> bool:
        """Whether a value is used once, in the block that makes it."""
        return self._count[value.number] == 1 and value.number not in self._elsewhere

    def _block(self, block: Block, results: Iterable[Scalar]) -> None:
        made: set[int] = set()
        for step in block.steps:
            if isinstance(step, Operation):
                self.makers[step.out.number] = step
            self._read(_read_by(step), made)
            match step:
                case BlockSwitch():
                    for inside, yields in zip(step.blocks, step.yields, strict=True):
                        self._block(inside, yields)
                case Loop():
                    self._block(step.condition, [step.active])
                    self._block(step.body, step.after)
                case _:
                    pass
            made.update(out.number for out in definitions(step))
        self._read(results, made)

    def _read(self, scalars: Iterable[Scalar], made: set[int]) -> None:
        for scalar in scalars:
            if isinstance(scalar, Value):
                self._count[scalar.number] += 1
                if scalar.number not in made:
                    self._elsewhere.add(scalar.number)


def _read_by(step: Step) -> Sequence[Scalar]:
    """The scalars that a step itself reads, without those of its blocks."""
    match step:
        case Operation(args=args) | Call(args=args):
            return args
        case Load(index=index, memory=memory):
            return [index, *memory.elements]
        case Store(index=index, value=value):
            return [index, value]
        case BlockSwitch(index=index):
            return [index]
        case Loop(before=before):
            return before
