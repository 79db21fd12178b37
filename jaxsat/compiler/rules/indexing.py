"""Rules of gathers, scatters and dynamic slices, with constant or computed indices."""

from collections.abc import Callable, Sequence
from itertools import product
from typing import SupportsIndex

import jax
import numpy as np
from jax.lax import GatherScatterMode

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Memory, Scalar, Value, is_uniform
from jaxsat.compiler.lowering import CannotLower, Elements, filled, lower, lowers
from jaxsat.compiler.operations import BOOL, INT
from jaxsat.compiler.rules.elementwise import extremum

CHOSEN = 16
"""Largest number of elements from which one is selected; more are put into memory."""

LARGEST = 1 << 20
"""Largest number of elements of a memory: with eight lanes of 64 bits, 64 MiB."""


def memory_of(
    dtype: np.dtype, size: int, uniform: bool, initial: np.ndarray | None = None
) -> Memory:
    """Return a memory of `size` numbers. Raises `CannotLower` where it would be too large."""
    if size > LARGEST:
        raise CannotLower(f"An array of {size} numbers is larger than {LARGEST}")
    return Memory(dtype, size, uniform, initial)


def stored(b: Builder, elements: np.ndarray) -> Memory:
    """Return a memory with the elements of an array in order; an external one exists already."""
    flat = list(elements.flat)
    dtype = flat[0].dtype
    if isinstance(flat[0], Value) and b.outside.get(flat[0].number) == flat:
        memory = Memory(dtype, len(flat), True)
        memory.elements = flat[:1]
        return memory
    if not any(isinstance(x, Value) for x in flat):
        return memory_of(dtype, len(flat), True, np.array(flat, dtype))
    memory = memory_of(dtype, len(flat), all(map(is_uniform, flat)))
    for number, scalar in enumerate(flat):
        b.store(memory, INT.type(number), scalar)
    return memory


def is_given(b: Builder, x: Elements) -> bool:
    """Whether an array is an argument of a function in a compact program, where it is read."""
    return bool(b.parameters) and all(
        isinstance(y, Value) and y.number in b.parameters for y in x.flat
    )


def element(b: Builder, elements: Sequence[Scalar], index: Scalar) -> Scalar:
    """Return the element with the number `index`, which is in range."""
    if not isinstance(index, Value):
        return elements[int(index)]
    if b.compact and any(isinstance(x, Value) for x in elements):
        memory = memory_of(elements[0].dtype, len(elements), True)
        memory.elements = list(elements)
        return b.load(memory, index)
    if b.compact or len(elements) > CHOSEN:
        return b.load(stored(b, np.array(list(elements), object)), index)
    result = elements[-1]
    for number in reversed(range(len(elements) - 1)):
        here = b.operation("le", index, index.dtype.type(number))
        result = b.select(here, elements[number], result)
    return result


def _index(b: Builder, x: Scalar) -> Scalar:
    """Return an index as a number of at least 32 bits."""
    return b.convert(x, INT) if x.dtype.itemsize < INT.itemsize else x


def _clamped(b: Builder, index: Scalar, last: int) -> Scalar:
    """Return the nearest index from zero to `last`, as a 32-bit number."""
    kind = index.dtype.type
    within = extremum(b, "min", extremum(b, "max", index, kind(0)), kind(last))
    return b.convert(within, INT)


def _linear(b: Builder, starts: Sequence[Scalar], shape: Sequence[int]) -> Scalar:
    """Return the index of an element in C order."""
    position: Scalar = INT.type(0)
    for start, size in zip(starts, shape, strict=True):
        position = b.operation("add", b.operation("mul", position, INT.type(size)), start)
    return position


def _reader(b: Builder, x: Elements, last: Sequence[int]) -> Callable[..., Scalar]:
    """Return a reader of the element `offset` after a start, which is from zero to `last`.

    Few elements are selected from; an array of many is put into memory once, unless it is given.
    """
    memories: list[Memory] = []

    def read(starts: Sequence[Scalar], offset: Sequence[int]) -> Scalar:
        window = tuple(
            slice(o, o + end + 1) if isinstance(start, Value) else int(start) + o
            for start, o, end in zip(starts, offset, last, strict=True)
        )
        part = x[window]
        unknown = [start for start in starts if isinstance(start, Value)]
        if not unknown:
            return part
        if len(unknown) == 1 and is_given(b, x):
            column = tuple(slice(None) if isinstance(w, slice) else w for w in window)
            (place,) = (s for s in _shifted(b, starts, offset) if isinstance(s, Value))
            return element(b, list(x[column].flat), place)
        if part.size <= CHOSEN:
            return element(b, list(part.flat), _linear(b, unknown, part.shape))
        if not memories:
            memories.append(stored(b, x))
        return b.load(memories[0], _linear(b, _shifted(b, starts, offset), x.shape))

    return read


def _shifted(b: Builder, starts: Sequence[Scalar], offset: Sequence[int]) -> list[Scalar]:
    return [b.operation("add", s, INT.type(o)) for s, o in zip(starts, offset, strict=True)]


@lowers("dynamic_slice")
def _dynamic_slice(b: Builder, eqn, x: Elements, *starts: Elements) -> Elements:
    sizes = eqn.parameters["slice_sizes"]
    where = [
        _clamped(b, _index(b, start[()]), dim - size)
        for start, dim, size in zip(starts, x.shape, sizes, strict=True)
    ]
    last = [dim - size for dim, size in zip(x.shape, sizes, strict=True)]
    reader, out = _reader(b, x, last), np.empty(sizes, object)
    for offset in np.ndindex(*sizes):
        out[offset] = reader(where, offset)
    return out


@lowers("dynamic_update_slice")
def _dynamic_update_slice(b: Builder, eqn, x: Elements, new: Elements, *starts: Elements):
    del eqn
    where = [
        _clamped(b, _index(b, start[()]), dim - size)
        for start, dim, size in zip(starts, x.shape, new.shape, strict=True)
    ]
    last = [dim - size for dim, size in zip(x.shape, new.shape, strict=True)]
    out = x.copy()
    for offset in np.ndindex(*new.shape):
        _put(b, out, where, offset, last, lambda old, o=offset: new[o])
    return out


def _put(
    b: Builder,
    x: Elements,
    starts: Sequence[Scalar],
    offset: Sequence[int],
    last: Sequence[int],
    new: Callable[[Scalar], Scalar],
) -> None:
    """Replace the element `offset` after a start by `new` of it, if the start is from zero to
    `last`."""
    possible = [
        range(end + 1) if isinstance(start, Value) else range(int(start), int(start) + 1)
        for start, end in zip(starts, last, strict=True)
    ]
    for numbers in product(*possible):
        here: Scalar = np.True_
        for start, number, end in zip(starts, numbers, last, strict=True):
            is_here = b.operation("eq", start, start.dtype.type(number))
            here = b.operation("and", here, is_here if 0 <= number <= end else np.False_)
        if isinstance(here, Value) or here:
            place = tuple(n + o for n, o in zip(numbers, offset, strict=True))
            x[place] = b.select(here, new(x[place]), x[place])


@lowers("gather")
def _gather(b: Builder, eqn, x: Elements, indices: Elements) -> Elements:
    numbers, sizes = eqn.parameters["dimension_numbers"], eqn.parameters["slice_sizes"]
    mode = eqn.parameters["mode"]
    aval = eqn.outputs[0].aval
    out = np.empty(aval.shape, object)
    gone = (*numbers.collapsed_slice_dims, *numbers.operand_batching_dims)
    window_dims = [d for d in range(x.ndim) if d not in gone]
    batch_dims = [d for d in range(out.ndim) if d not in numbers.offset_dims]
    last = [dim - size for dim, size in zip(x.shape, sizes, strict=True)]
    reader = _reader(b, x, last)
    for index in np.ndindex(*out.shape):
        batch = tuple(index[d] for d in batch_dims)
        offset = [0] * x.ndim
        for dim, place in zip(window_dims, numbers.offset_dims, strict=True):
            offset[dim] = index[place]
        starts = _starts(b, x.ndim, indices[batch], numbers.start_index_map)
        for dim, of in zip(
            numbers.operand_batching_dims, numbers.start_indices_batching_dims, strict=True
        ):
            starts[dim] = INT.type(batch[of])
        if mode == GatherScatterMode.FILL_OR_DROP:
            # JAX makes these indices 32-bit numbers before it compares them
            starts = [b.convert(start, INT) for start in starts]
        within = [_clamped(b, s, end) for s, end in zip(starts, last, strict=True)]
        value = reader(within, offset)
        if mode == GatherScatterMode.FILL_OR_DROP:
            value = b.select(_inside(b, starts, last), value, _filling(eqn, value.dtype))
        out[index] = value
    return out


def _starts(
    b: Builder, rank: int, indices: Elements, dims: Sequence[SupportsIndex]
) -> list[Scalar]:
    """Return the start of a window by dimension; zero in those without an index."""
    starts: list[Scalar] = [INT.type(0)] * rank
    for index, dim in zip(indices, dims, strict=True):
        starts[dim] = _index(b, index)
    return starts


def _inside(b: Builder, starts: Sequence[Scalar], last: Sequence[int]) -> Scalar:
    condition: Scalar = np.True_
    for start, end in zip(starts, last, strict=True):
        kind = start.dtype.type
        condition = b.operation("and", condition, b.operation("ge", start, kind(0)))
        condition = b.operation("and", condition, b.operation("le", start, kind(end)))
    return condition


def _filling(eqn, dtype: np.dtype) -> Scalar:
    value = eqn.parameters["fill_value"]
    if value is not None:
        return dtype.type(value)
    if dtype.kind == "f":
        return dtype.type(np.nan)
    if dtype == BOOL:
        return np.True_
    info = jax.numpy.iinfo(dtype)
    return dtype.type(info.min if dtype.kind == "i" else info.max)


@lowers("scatter", *(f"scatter-{join}" for join in ("add", "sub", "mul", "min", "max")))
def _scatter(b: Builder, eqn, x: Elements, indices: Elements, updates: Elements) -> Elements:
    numbers, mode = eqn.parameters["dimension_numbers"], eqn.parameters["mode"]
    join = eqn.name.removeprefix("scatter").removeprefix("-")
    gone = (*numbers.inserted_window_dims, *numbers.operand_batching_dims)
    window_dims = [d for d in range(x.ndim) if d not in gone]
    batch_dims = [d for d in range(updates.ndim) if d not in numbers.update_window_dims]
    sizes = [1] * x.ndim
    for dim, place in zip(window_dims, numbers.update_window_dims, strict=True):
        sizes[dim] = updates.shape[place]
    last = [dim - size for dim, size in zip(x.shape, sizes, strict=True)]
    out = x.copy()
    for index in np.ndindex(*updates.shape):
        batch = tuple(index[d] for d in batch_dims)
        offset = [0] * x.ndim
        for dim, place in zip(window_dims, numbers.update_window_dims, strict=True):
            offset[dim] = index[place]
        starts = _starts(b, x.ndim, indices[batch], numbers.scatter_dims_to_operand_dims)
        for dim, of in zip(
            numbers.operand_batching_dims, numbers.scatter_indices_batching_dims, strict=True
        ):
            starts[dim] = INT.type(batch[of])
        if mode == GatherScatterMode.CLIP:
            starts = [_clamped(b, s, end) for s, end in zip(starts, last, strict=True)]
        _put(b, out, starts, offset, last, _joined(b, eqn, join, updates[index]))
    return out


def _joined(b: Builder, eqn, join: str, new: Scalar):
    if not join:
        return lambda old: _updated(b, eqn, old, new)
    if join in ("min", "max"):
        return lambda old: extremum(b, join, old, new)
    if join in ("add", "mul", "sub"):
        return lambda old: b.operation(join, old, new)
    raise CannotLower(f"A scatter that joins by {join} is not supported")


def _updated(b: Builder, eqn, old: Scalar, new: Scalar) -> Scalar:
    """Return the new value of an element: the update, or a function of the old one."""
    program = eqn.parameters["update"]
    if program is None:
        return new
    return lower(b, program, [filled((), old), filled((), new)])[0][()]
