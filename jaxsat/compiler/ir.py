"""A small structured program over scalars of many lanes, between jaxpr and machine code.

Every lane of a vector register carries one trajectory. A value is *uniform* where it is the same in
all lanes by construction, and then it is computed once, as a scalar; otherwise it is *varying*.
Constants are NumPy scalars and no values at all. A program is a block of operations in order, in
which loops, switches and calls hold blocks of their own. `interpreter` runs it in NumPy, `llvm`
prints it as LLVM code; nothing else is known of it.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, count
from typing import Any

import numpy as np

from jaxsat.core.errors import JaxsatError

_numbers = count()


class NativeBug(JaxsatError):
    """The compiled engine itself broke down, which no program must bring about."""

    def __init__(self, where: str, what: object):
        super().__init__(
            f"The native engine broke down in {where}: {what!r}. This is a bug in jaxsat: please "
            f"report it with this message. The engine `scan` runs the same program."
        )


class Value:
    """One scalar in every lane (or, uniform, one for all), known only when the program runs."""

    __slots__ = ("dtype", "number", "uniform")

    def __init__(self, dtype: np.dtype, uniform: bool):
        self.dtype = dtype
        self.uniform = uniform
        self.number = next(_numbers)

    def __repr__(self) -> str:
        return f"{'u' if self.uniform else 'v'}{self.number}:{self.dtype.name}"


Scalar = Value | np.generic


class Memory:
    """`size` scalars in memory: element after element, each with all its lanes unless uniform.

    With `initial` it holds these numbers and is never written; with `elements` it is an array of
    values that are there already: all of them, or the first of an array from outside.
    """

    __slots__ = ("dtype", "elements", "initial", "number", "size", "uniform")

    def __init__(
        self, dtype: np.dtype, size: int, uniform: bool, initial: np.ndarray | None = None
    ):
        self.dtype, self.size, self.uniform, self.initial = dtype, size, uniform, initial
        self.number = next(_numbers)
        self.elements: Sequence[Scalar] = ()

    def __repr__(self) -> str:
        return f"m{self.number}[{self.size}]"


@dataclass(slots=True)
class Operation:
    """One arithmetic operation of the table in `operations`."""

    name: str
    args: tuple[Scalar, ...]
    out: Value


@dataclass(slots=True)
class Load:
    """An element of a memory; a varying index gives every lane another one."""

    memory: Memory
    index: Scalar
    out: Value


@dataclass(slots=True)
class Store:
    """Puts a value at an element of a memory; the index is uniform."""

    memory: Memory
    index: Scalar
    value: Scalar


class Block:
    """Operations in order. What the blocks around it have computed is known in it, too."""

    __slots__ = ("known", "outer", "steps")

    def __init__(self, outer: "Block | None" = None):
        self.steps: list[Step] = []
        self.outer = outer
        self.known: dict[tuple, Scalar] = {}

    def find(self, key: tuple) -> Any:
        """What is known under a key here or in a block around; None for nothing."""
        block: Block | None = self
        while block is not None:
            value = block.known.get(key)
            if value is not None:
                return value
            block = block.outer
        return None

    def calls(self) -> "Iterator[Call]":
        """All calls of this block and of those in it."""
        for step in self.steps:
            if isinstance(step, Call):
                yield step
            for inside in blocks_in(step):
                yield from inside.calls()


@dataclass(slots=True)
class Loop:
    """`while condition(params): params = body(params)`; afterwards the params are its results.

    `active` is the condition's value. Where it is varying the loop goes on while any lane is
    active, and the params of a lane that is not stay as they are.
    """

    params: list[Value]
    before: list[Scalar]
    condition: Block
    active: Scalar
    body: Block
    after: list[Scalar]


@dataclass(slots=True)
class BlockSwitch:
    """The block number `index`, which is uniform and in range; `yields` are their results.

    Blocks after the first are `cold` (hardly ever run) or not.
    """

    index: Scalar
    blocks: list[Block]
    yields: list[list[Scalar]]
    outs: list[Value]
    cold: bool = False


@dataclass(frozen=True)
class Source:
    """The Python function that a function was, and the shapes of its arrays, whose elements are the
    parameters and results in order.

    With `loop` it is an operation on arrays that is written as a loop instead: "product", summed
    over `axes`, and "sum", both in order and from 0.0; "argmin" and "argmax".
    """

    name: str
    file: str
    params: Sequence[tuple[int, ...]]
    results: Sequence[tuple[int, ...]]
    loop: str = ""
    axes: tuple[int, int] = (0, 0)


@dataclass(slots=True)
class Function:
    """A program of its own, called from others; what is stored is in `Store` steps alone.

    `parts` are functions for single results, for who needs one only, or nothing.
    """

    name: str
    params: list[Value]
    block: Block
    results: list[Scalar]
    parts: Sequence["Function"] = ()
    source: Source | None = None


@dataclass(slots=True)
class Call:
    """A function applied to values."""

    function: Function
    args: list[Scalar]
    outs: list[Value]


Step = Operation | Load | Store | Loop | BlockSwitch | Call


def definitions(step: Step) -> Sequence[Value]:
    """The values that a step gives to those after it."""
    match step:
        case Operation(out=out) | Load(out=out):
            return [out]
        case Store():
            return []
        case Loop(params=outs) | BlockSwitch(outs=outs) | Call(outs=outs):
            return outs


def blocks_in(step: Step) -> Sequence[Block]:
    """The blocks of a loop or a switch, each after what it may read."""
    match step:
        case Loop(condition=condition, body=body):
            return (condition, body)
        case BlockSwitch(blocks=blocks):
            return blocks
    return ()


def uses(step: Step) -> Iterable[int]:
    """Numbers of the values from outside that a step reads."""
    match step:
        case Operation(args=args) | Call(args=args):
            return numbers_of(args)
        case Load(index=index, memory=memory):
            return numbers_of([index, *memory.elements])
        case Store(index=index, value=value):
            return numbers_of([index, value])
    return _uses_inside(step)


def _uses_inside(step: "Loop | BlockSwitch") -> set[int]:
    match step:
        case BlockSwitch():
            used = set(numbers_of([step.index]))
            for block, results in zip(step.blocks, step.yields, strict=True):
                used |= _uses_in(block, results)
            return used
        case Loop():
            used = _uses_in(step.condition, [step.active]) | _uses_in(step.body, step.after)
            used.difference_update(param.number for param in step.params)
            used.difference_update(_defined_in(step.condition))
            return used.union(numbers_of(step.before))


def _uses_in(block: Block, results: Iterable[Scalar]) -> set[int]:
    used = set(numbers_of(results))
    for step in block.steps:
        used.update(uses(step))
    return used.difference(_defined_in(block))


def _defined_in(block: Block) -> Iterator[int]:
    return (out.number for step in block.steps for out in definitions(step))


def reads(block: Block) -> Iterator[int]:
    """Numbers of the values that the steps of a block and of the blocks inside read, each time."""
    for step in block.steps:
        match step:
            case BlockSwitch(index=index, yields=yields):
                yield from numbers_of([index, *chain.from_iterable(yields)])
            case Loop(before=before, active=active, after=after):
                yield from numbers_of([*before, active, *after])
            case _:
                yield from uses(step)
        for inside in blocks_in(step):
            yield from reads(inside)


def numbers_of(scalars: Iterable[Scalar]) -> list[int]:
    """Numbers of the values among scalars."""
    return [x.number for x in scalars if isinstance(x, Value)]


def is_uniform(x: Scalar) -> bool:
    """Whether a scalar is the same in all lanes."""
    return x.uniform if isinstance(x, Value) else True


def memories(step: Step) -> Iterator[Memory]:
    """What a step reads or writes that may be written."""
    match step:
        case Operation():
            return
        case Load(memory=memory) | Store(memory=memory):
            if memory.initial is None:
                yield memory
        case Call(function=Function(block=block)):
            yield from _memories_in(block)
        case _:
            for block in blocks_in(step):
                yield from _memories_in(block)


def _memories_in(block: Block) -> Iterator[Memory]:
    for step in block.steps:
        yield from memories(step)
