"""A small structured program over scalars of many lanes, between jaxpr and machine code.

Every lane of a vector register carries one trajectory. A value is *uniform* where it is the same in
all lanes by construction, and then it is computed once, as a scalar; otherwise it is *varying*.
Constants are NumPy scalars and no values at all. A program is a block of operations in order, in
which loops, switches and calls hold blocks of their own. `interpreter` runs it in NumPy, `llvm`
prints it as LLVM code.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count
from typing import Any

import numpy as np

from jaxsat.core.errors import JaxsatError

_numbers = count()


class NativeBug(JaxsatError):
    """Breakdown of the compiled engine itself: a bug, whatever the program."""

    def __init__(self, where: str, what: object):
        super().__init__(
            f"The native engine broke down in {where}: {what!r}. This is a bug in jaxsat: please "
            f"report it with this message. The engine `scan` runs the same program."
        )


class Value:
    """Scalar computed at run time: one per lane or, if uniform, one for all lanes."""

    __slots__ = ("dtype", "number", "uniform")

    def __init__(self, dtype: np.dtype, uniform: bool):
        self.dtype = dtype
        self.uniform = uniform
        self.number = next(_numbers)

    def __repr__(self) -> str:
        return f"{'u' if self.uniform else 'v'}{self.number}:{self.dtype.name}"


Scalar = Value | np.generic


class NamedNumber(np.int32):
    """A constant with the name that a printer gives it."""

    name: str

    @staticmethod
    def of(x: np.generic, names: Mapping[int, str]) -> np.generic:
        """Return a number of 32 bits with its name, or another one as it is."""
        name = names.get(int(x)) if names and x.dtype == np.int32 else None
        return x if name is None else NamedNumber(int(x), name)

    def __new__(cls, number: int, name: str) -> "NamedNumber":
        """Return the number with a name."""
        one = super().__new__(cls, number)
        one.name = name
        return one


class Memory:
    """Array of `size` scalars, element after element, each with all its lanes unless uniform.

    With `initial` it is a constant array of these numbers, which have `names` for printers; with
    `elements` it is an array of existing values: all of them, or the first of an array from
    outside.
    """

    __slots__ = ("dtype", "elements", "initial", "names", "number", "size", "uniform")

    def __init__(
        self, dtype: np.dtype, size: int, uniform: bool, initial: np.ndarray | None = None
    ):
        self.dtype, self.size, self.uniform, self.initial = dtype, size, uniform, initial
        self.number = next(_numbers)
        self.elements: Sequence[Scalar] = ()
        self.names: Mapping[int, str] = {}

    def __repr__(self) -> str:
        return f"m{self.number}[{self.size}]"


@dataclass(slots=True)
class Operation:
    """Arithmetic operation of the table in `operations`."""

    name: str
    args: tuple[Scalar, ...]
    out: Value


@dataclass(slots=True)
class Load:
    """Read of an element of a memory; each lane reads its own where the index varies."""

    memory: Memory
    index: Scalar
    out: Value


@dataclass(slots=True)
class Store:
    """Write of a value to an element of a memory; the index is uniform."""

    memory: Memory
    index: Scalar
    value: Scalar


class Block:
    """Steps in order, which may use values of the blocks around it.

    `outcomes` are those of predicates, by number, whenever the block runs.
    """

    __slots__ = ("outcomes", "outer", "steps", "values")

    def __init__(self, outer: "Block | None" = None):
        self.steps: list[Step] = []
        self.outer = outer
        self.values: dict[tuple, Scalar] = {}
        self.outcomes: dict[int, bool] = {}

    def find(self, key: tuple) -> Any:
        """Value recorded under `key` in this block or one around it, or None."""
        block: Block | None = self
        while block is not None:
            value = block.values.get(key)
            if value is not None:
                return value
            block = block.outer
        return None

    def decided(self, x: Scalar) -> Scalar:
        """Return the outcome of a predicate that this block or one around it knows, else `x`."""
        block: Block | None = self
        while block is not None and isinstance(x, Value):
            outcome = block.outcomes.get(x.number)
            if outcome is not None:
                return np.bool_(outcome)
            block = block.outer
        return x

    def calls(self) -> "Iterator[Call]":
        """Calls in this block and in the blocks inside it."""
        for step in self.steps:
            if isinstance(step, Call):
                yield step
            for inside in blocks_in(step):
                yield from inside.calls()


@dataclass(slots=True)
class Loop:
    """`while condition(params): params = body(params)`; the results are the last params.

    `active` is the condition's value. Where it varies, the loop runs while any lane is active,
    and inactive lanes keep their params.
    """

    params: list[Value]
    before: list[Scalar]
    condition: Block
    active: Scalar
    body: Block
    after: list[Scalar]


@dataclass(slots=True)
class BlockSwitch:
    """Execution of the block of number `index` (uniform, in range); `yields` are block results.

    `cold`: blocks after the first hardly ever run. `names` are names of numbers of blocks for
    printers.
    """

    index: Scalar
    blocks: list[Block]
    yields: list[list[Scalar]]
    outs: list[Value]
    cold: bool = False
    names: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """Python function behind a `Function`, and shapes of its arrays, whose elements in order are
    the parameters and results.

    `loop` names an operation on arrays to print as a loop: "product", summed over `axes`, and
    "sum", both in order and from 0.0; "argmin" and "argmax".
    """

    name: str
    file: str
    params: Sequence[tuple[int, ...]]
    results: Sequence[tuple[int, ...]]
    loop: str = ""
    axes: tuple[int, int] = (0, 0)


@dataclass(slots=True)
class Function:
    """Program called from others; its only side effects are `Store` steps.

    `parts`, if any, are one function per result, for callers that use a single one.
    """

    name: str
    params: list[Value]
    block: Block
    results: list[Scalar]
    parts: Sequence["Function"] = ()
    source: Source | None = None


@dataclass(slots=True)
class Call:
    """Call of a function with values."""

    function: Function
    args: list[Scalar]
    outs: list[Value]


Step = Operation | Load | Store | Loop | BlockSwitch | Call


def definitions(step: Step) -> Sequence[Value]:
    """Values that a step defines for later steps."""
    match step:
        case Operation(out=out) | Load(out=out):
            return [out]
        case Store():
            return []
        case Loop(params=outs) | BlockSwitch(outs=outs) | Call(outs=outs):
            return outs


def blocks_in(step: Step) -> Sequence[Block]:
    """Blocks of a loop or switch, each after those whose values it may use."""
    match step:
        case Loop(condition=condition, body=body):
            return (condition, body)
        case BlockSwitch(blocks=blocks):
            return blocks
    return ()


Memo = dict[tuple[str, int], tuple[Any, set]]
"""Memo of a pass, by the identity of a step or function: this, and what it reads or touches."""


def uses(step: Step, memo: Memo | None = None) -> Iterable[int]:
    """Numbers of the values from outside a step that it reads.

    Loops and switches in `memo` are not searched again.
    """
    match step:
        case Operation(args=args) | Call(args=args):
            return numbers_of(args)
        case Load(index=index, memory=memory):
            return numbers_of([index, *memory.elements])
        case Store(index=index, value=value):
            return numbers_of([index, value])
    memo = {} if memo is None else memo
    key = ("uses", id(step))
    if key not in memo:
        memo[key] = (step, _uses_inside(step, memo))
    return memo[key][1]


def _uses_inside(step: "Loop | BlockSwitch", memo: Memo) -> set[int]:
    match step:
        case BlockSwitch():
            used = set(numbers_of([step.index]))
            for block, results in zip(step.blocks, step.yields, strict=True):
                used |= _uses_in(block, results, memo)
            return used
        case Loop():
            used = _uses_in(step.condition, [step.active], memo)
            used |= _uses_in(step.body, step.after, memo)
            used.difference_update(param.number for param in step.params)
            used.difference_update(_defined_in(step.condition))
            return used.union(numbers_of(step.before))


def _uses_in(block: Block, results: Iterable[Scalar], memo: Memo) -> set[int]:
    used = set(numbers_of(results))
    for step in block.steps:
        used.update(uses(step, memo))
    return used.difference(_defined_in(block))


def _defined_in(block: Block) -> Iterator[int]:
    return (out.number for step in block.steps for out in definitions(step))


def reads(block: Block) -> Iterator[int]:
    """Numbers of the values that a block and the blocks inside read, repeated per read."""
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


def memories(step: Step, memo: Memo | None = None) -> set[Memory]:
    """Writable memories that a step reads or writes.

    Functions, loops and switches in `memo` are not searched again.
    """
    match step:
        case Operation():
            return set()
        case Load(memory=memory) | Store(memory=memory):
            return {memory} if memory.initial is None else set()
        case Call(function=function):
            whole, blocks = function, [function.block]
        case _:
            whole, blocks = step, blocks_in(step)
    memo = {} if memo is None else memo
    key = ("memories", id(whole))
    if key not in memo:
        inside = [memories(one, memo) for block in blocks for one in block.steps]
        memo[key] = (whole, set().union(*inside))
    return memo[key][1]
