"""Where a stage finds its numbers and leaves its results, and how the former are read."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from jaxsat.engine.native.ir import Block, Call, Function, Loop, Switch, Value
from jaxsat.engine.native.lines import AbstractLines
from jaxsat.engine.native.words import memory_type


@dataclass(frozen=True)
class PerCase:
    """Element `element` of an array (cases, size)."""

    array: int
    element: int
    size: int


@dataclass(frozen=True)
class Shared:
    """Element `element` of an array that is the same for all cases."""

    array: int
    element: int


@dataclass(frozen=True)
class Slot:
    """A place in the state, in bytes from its beginning; room for all lanes or, uniform, one."""

    offset: int
    uniform: bool


@dataclass(frozen=True)
class Number:
    """The stage's argument `a` or `b`."""

    name: str


Place = PerCase | Shared | Slot | Number
Known = Mapping[int, Shared | Slot]
"""Places of values by their numbers: whoever has the stage's pointers can read them."""

FROM = "ptr noalias %pointers, ptr noalias %state"

FIRST = 1
"""Before the addresses of the arrays from outside stands that of the arena (`lines.Module`)."""


def read_later(lines: AbstractLines, value: Value, place: Shared | Slot) -> None:
    """Let a value be read in every block that needs it: it need not be kept in between."""
    lines.readers[value.number] = lambda out: _read(lines, out, value.dtype, place)


def array_of(lines: AbstractLines, number: int) -> str:
    """The address of an array from outside."""

    def load(out: str) -> None:
        place = lines.fresh("p")
        lines.line(f"{place} = getelementptr ptr, ptr %pointers, i64 {number + FIRST}")
        lines.line(f"{out} = load ptr, ptr {place}")

    return lines.once_in_block(("array", number), load)


def _read(lines: AbstractLines, out: str, dtype: np.dtype, place: Shared | Slot) -> None:
    where = lines.fresh("p")
    if isinstance(place, Slot):
        lines.line(f"{where} = getelementptr i8, ptr %state, i64 {place.offset}")
        lines.get(out, where, dtype, not place.uniform)
        return
    base, kind = array_of(lines, place.array), memory_type(dtype)
    lines.line(f"{where} = getelementptr {kind}, ptr {base}, i64 {place.element}")
    lines.get(out, where, dtype, False)


def known_to_functions(block: Block, places: Known) -> dict[int, dict[int, Shared | Slot]]:
    """For functions that a stage calls, by identity: parameters that are always one of `places`.

    Functions that others call as well have none.
    """
    calls = list(_calls(block))
    inner = {id(call.function) for outer in calls for call in _calls(outer.function.block)}
    known: dict[int, dict[int, Shared | Slot]] = {}
    functions: dict[int, Function] = {id(call.function): call.function for call in calls}
    for identity, function in functions.items():
        if identity in inner:
            continue
        every = [call.args for call in calls if call.function is function]
        for param, *args in zip(function.params, *every, strict=True):
            numbers = {arg.number if isinstance(arg, Value) else None for arg in args}
            number = numbers.pop()
            if not numbers and number is not None and number in places:
                known.setdefault(identity, {})[param.number] = places[number]
    return known


def _calls(block: Block) -> Iterator[Call]:
    for step in block.steps:
        match step:
            case Call():
                yield step
            case Loop():
                yield from _calls(step.condition)
                yield from _calls(step.body)
            case Switch():
                for inside in step.blocks:
                    yield from _calls(inside)
