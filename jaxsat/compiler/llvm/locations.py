"""Locations of an entry point's numbers and results in memory.

Numbers are rematerialised: loaded again in every basic block that needs them rather than kept in
registers, which lowers register pressure.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler.ir import Block, Function, Value
from jaxsat.compiler.llvm.emitter import AbstractEmitter, memory_type


@dataclass(frozen=True)
class PerCase:
    """Element `element` of an array (cases, size)."""

    array: int
    element: int
    size: int


@dataclass(frozen=True)
class SharedElement:
    """Element `element` of an array that is the same for all cases."""

    array: int
    element: int


@dataclass(frozen=True)
class Slot:
    """An offset in the state, in bytes from its beginning; room for all lanes or, uniform, one."""

    offset: int
    uniform: bool


@dataclass(frozen=True)
class ScalarArgument:
    """The entry point's argument `a` or `b`."""

    name: str


Location = PerCase | SharedElement | Slot | ScalarArgument
Places = Mapping[int, SharedElement | Slot]
"""Locations of values by number, for all functions with the entry point's pointers."""

CONTEXT = "ptr noalias %pointers, ptr noalias %state"

FIRST = 1
"""Index of the first external array's address, behind that of the arena (`emitter.Module`)."""


def rematerialise(emitter: AbstractEmitter, value: Value, location: SharedElement | Slot) -> None:
    """Load a value in every block that needs it, so that no register keeps it in between."""
    emitter.readers[value.number] = lambda out: _read(emitter, out, value.dtype, location)
    if isinstance(location, SharedElement):
        emitter.outside[value.number] = lambda: _address(emitter, value.dtype, location)


def array_pointer(emitter: AbstractEmitter, number: int) -> str:
    """Return the address of an external array."""

    def load(out: str) -> None:
        pointer = emitter.fresh("p")
        emitter.line(f"{pointer} = getelementptr ptr, ptr %pointers, i64 {number + FIRST}")
        emitter.line(f"{out} = load ptr, ptr {pointer}")

    return emitter.once_in_block(("array", number), load)


def _read(
    emitter: AbstractEmitter, out: str, dtype: np.dtype, location: SharedElement | Slot
) -> None:
    if isinstance(location, SharedElement):
        emitter.get(out, _address(emitter, dtype, location), dtype, False)
        return
    where = emitter.fresh("p")
    emitter.line(f"{where} = getelementptr i8, ptr %state, i64 {location.offset}")
    emitter.get(out, where, dtype, not location.uniform)


def _address(emitter: AbstractEmitter, dtype: np.dtype, location: SharedElement) -> str:
    where, base = emitter.fresh("p"), array_pointer(emitter, location.array)
    kind = memory_type(dtype)
    emitter.line(f"{where} = getelementptr {kind}, ptr {base}, i64 {location.element}")
    return where


def parameter_locations(
    block: Block, locations: Places
) -> dict[int, dict[int, SharedElement | Slot]]:
    """Return the parameters always in one location, for functions that an entry point calls.

    The result is by the function's identity. Functions that others call as well have none.
    """
    calls = list(block.calls())
    inner = {id(call.function) for outer in calls for call in outer.function.block.calls()}
    places: dict[int, dict[int, SharedElement | Slot]] = {}
    functions: dict[int, Function] = {id(call.function): call.function for call in calls}
    for identity, function in functions.items():
        if identity in inner:
            continue
        every = [call.args for call in calls if call.function is function]
        for param, *args in zip(function.params, *every, strict=True):
            numbers = {arg.number if isinstance(arg, Value) else None for arg in args}
            number = numbers.pop()
            if not numbers and number is not None and number in locations:
                places.setdefault(identity, {})[param.number] = locations[number]
    return places
