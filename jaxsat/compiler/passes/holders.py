"""What each place of a program holds: the scalars and constants that can arrive in it.

A *holder* is the number of a value or memory, or an identity and an index for a result of a
function. Passes that give holders of one kind another type or a name use `slots`.
"""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler import ir


@dataclass(frozen=True, slots=True)
class Content:
    """A scalar, or another holder, that a holder takes over; `put` replaces a constant there."""

    holder: Hashable
    content: ir.Scalar | Hashable
    put: Callable[[np.generic], None]

    @property
    def source(self) -> Hashable:
        """The holder of the content, None for a constant."""
        return None if isinstance(self.content, np.generic) else node(self.content)


class Classes:
    """Sets of holders of the same kind."""

    def __init__(self) -> None:
        self._parents: dict[Hashable, Hashable] = {}

    def of(self, holder: Hashable) -> Hashable:
        """Return the representative of a holder's set."""
        root = holder
        while root in self._parents:
            root = self._parents[root]
        while holder != root:
            self._parents[holder], holder = root, self._parents[holder]
        return root

    def join(self, one: Hashable, other: Hashable) -> None:
        """Put two holders into one set."""
        one, other = self.of(one), self.of(other)
        if one != other:
            self._parents[other] = one


def node(x: object) -> Hashable:
    """Return the holder that a value or memory is, or the holder itself."""
    return x.number if isinstance(x, ir.Value | ir.Memory) else x  # pyright: ignore


def result(function: ir.Function, number: int) -> Hashable:
    """Return the holder of a result of a function."""
    return (id(function), number)


def functions_of(function: ir.Function) -> list[ir.Function]:
    """Return a function and those of Python code that it calls, directly or not, each once."""
    functions, waiting = {}, [function]
    while waiting:
        one = waiting.pop()
        if id(one) not in functions:
            functions[id(one)] = one
            waiting += [x.function for x in one.block.calls() if x.function.source is not None]
    return list(functions.values())


def steps_in(block: ir.Block) -> Iterator[ir.Step]:
    """Yield all steps of a block and of the blocks inside it."""
    for step in block.steps:
        yield step
        for inside in ir.blocks_in(step):
            yield from steps_in(inside)


def slots(
    function: ir.Function, alike: frozenset[str], compared: frozenset[str]
) -> Iterator[Content]:
    """Yield the slots of a function, without those of functions that it calls.

    The results of the operations `alike` hold their operands of the same type, and the operands of
    those `compared` hold each other.
    """
    for i in range(len(function.results)):
        yield _at(result(function, i), function.results, i)
    for step in steps_in(function.block):
        match step:
            case ir.Operation():
                yield from _of_operation(step, alike, compared)
            case ir.Load(memory=memory, out=out):
                yield Content(out.number, memory.number, _constant)
                elements = list(memory.elements)
                memory.elements = elements
                yield from (_at(memory.number, elements, i) for i in range(len(elements)))
            case ir.Store(memory=memory):
                yield Content(memory.number, step.value, lambda x, to=step: setattr(to, "value", x))
            case ir.Loop():
                for i, param in enumerate(step.params):
                    yield _at(param.number, step.before, i)
                    yield _at(param.number, step.after, i)
            case ir.BlockSwitch():
                for yields in step.yields:
                    yield from (_at(x.number, yields, i) for i, x in enumerate(step.outs))
            case ir.Call(function=ir.Function(source=None)):
                pass
            case ir.Call():
                called = step.function
                yield from (_at(x.number, step.args, i) for i, x in enumerate(called.params))
                for i, out in enumerate(step.outs):
                    yield Content(out.number, result(called, i), _constant)


def _of_operation(
    step: ir.Operation, alike: frozenset[str], compared: frozenset[str]
) -> Iterator[Content]:
    first = int(step.name == "select")
    values = [x for x in step.args if isinstance(x, ir.Value)]
    if step.name in alike:
        holder: Hashable = step.out.number
    elif step.name in compared and values:
        holder = values[0].number
    else:
        return
    for i in range(first, len(step.args)):

        def put(x: np.generic, place: int = i) -> None:
            step.args = (*step.args[:place], x, *step.args[place + 1 :])

        yield Content(holder, step.args[i], put)


def _at(holder: Hashable, scalars: list[ir.Scalar], place: int) -> Content:
    return Content(holder, scalars[place], lambda x: scalars.__setitem__(place, x))


def _constant(x: np.generic) -> None:
    raise AssertionError(x)
