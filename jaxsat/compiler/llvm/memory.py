"""Arrays that are indexed by numbers known only when the program runs."""

from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Memory, Scalar, Value, is_uniform
from jaxsat.compiler.lowering import CannotLower
from jaxsat.compiler.operations import INT

CHOSEN = 16
"""Of at most so many elements one is found by selections; more are put into memory."""

LARGEST = 1 << 20
"""Elements of a memory: with eight lanes of 64 bits, 64 MiB."""


def memory_of(
    dtype: np.dtype, size: int, uniform: bool, initial: np.ndarray | None = None
) -> Memory:
    """A memory. Raises `CannotLower` where it would be too large."""
    if size > LARGEST:
        raise CannotLower(f"An array of {size} numbers is larger than {LARGEST}")
    return Memory(dtype, size, uniform, initial)


def stored(b: Builder, elements: np.ndarray) -> Memory:
    """A memory that holds the elements of an array in order."""
    flat = list(elements.flat)
    dtype = flat[0].dtype
    if not any(isinstance(x, Value) for x in flat):
        return memory_of(dtype, len(flat), True, np.array(flat, dtype))
    memory = memory_of(dtype, len(flat), all(map(is_uniform, flat)))
    for number, scalar in enumerate(flat):
        b.store(memory, INT.type(number), scalar)
    return memory


def element(b: Builder, elements: Sequence[Scalar], index: Scalar) -> Scalar:
    """Element `index`, which is in range."""
    if not isinstance(index, Value):
        return elements[int(index)]
    if b.compact and any(isinstance(x, Value) for x in elements):
        memory = memory_of(elements[0].dtype, len(elements), True)
        memory.elements = list(elements)
        return b.load(memory, index)
    if b.compact or len(elements) > CHOSEN:
        return b.load(stored(b, np.array(list(elements), object)), index)
    chosen = elements[-1]
    for number in reversed(range(len(elements) - 1)):
        here = b.operation("le", index, index.dtype.type(number))
        chosen = b.select(here, elements[number], chosen)
    return chosen
