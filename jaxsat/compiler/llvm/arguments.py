"""External arrays: checked and copied before machine code gets their addresses.

Machine code uses addresses alone. It therefore reads a copy of our own, of the shape and type for
which it was made, aligned and without gaps, unaffected by changes to the caller's array (which may
be freed, resized or written by another thread).
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler.llvm.emitter import ALIGNMENT
from jaxsat.compiler.lowering import KINDS, number_type, numbers_in
from jaxsat.core.errors import ArgumentError

LARGEST = 8
"""Bytes of the largest number that machine code supports."""


@dataclass(frozen=True)
class Argument:
    """Requirements on one array; with `per_case`, shape and type are those of one case."""

    name: str
    shape: tuple[int, ...]
    dtype: Any
    per_case: bool

    def taken(self, x: Any) -> np.ndarray:
        """Return a copy of `x` as numbers.

        Raises `TypeError` for numbers of a type that this one cannot represent, and `ValueError`
        for a wrong shape.
        """
        self._require_shape(np.shape(x))  # before anything large is copied
        array = self._copied(x)
        self._require_shape(array.shape)  # whatever shape `x` claims
        return array

    def _require_shape(self, shape: tuple[int, ...]) -> None:
        if shape[self.per_case :] != self.shape or (self.per_case and not shape):
            axes = ", ".join(["cases"] * self.per_case + [str(n) for n in self.shape])
            raise ArgumentError(self.name, f"must have the shape ({axes})", shape)

    def _copied(self, x: Any) -> np.ndarray:
        source_type, dtype = getattr(x, "dtype", None), number_type(self.dtype)
        if source_type is dtype and dtype == self.dtype:  # as it mostly is, and quick
            return np.array(x, dtype, order="C")
        if dtype != self.dtype:  # typed random keys, and derivatives that are none
            if source_type != self.dtype:
                raise self._wrong_type(source_type or type(x).__name__)
            return np.array(numbers_in(x), dtype, order="C")
        weak = type(x) in (bool, int, float)
        array = x if weak else as_numbers(self.name, x)
        if not (np.result_type(x, dtype) == dtype if weak else np.can_cast(array.dtype, dtype)):
            raise self._wrong_type(type(x).__name__ if weak else array.dtype)
        try:
            return np.array(array, dtype, order="C")
        except OverflowError:
            raise ArgumentError(self.name, f"must be in the range of {dtype}", x) from None

    def _wrong_type(self, got: Any) -> TypeError:
        return TypeError(
            f"Argument `{self.name}` must have the type {self.dtype}, or one that this can "
            f"represent, but got {got}."
        )


@dataclass(frozen=True)
class Arguments:
    """Arguments of a program: trees by name; those in `per_case` have the axis of cases."""

    structures: Mapping[str, Any]
    leaves: Sequence[Argument]

    @staticmethod
    def of(examples: Mapping[str, PyTree], avals: Sequence[Any], per_case: str) -> "Arguments":
        """Return the arguments of a program of trees like the examples, traced as `avals`."""
        names = [
            (tree, tree + jax.tree_util.keystr(path))
            for tree, example in examples.items()
            for path, _ in jax.tree_util.tree_leaves_with_path(example)
        ]
        leaves = [
            Argument(name, aval.shape, aval.dtype, tree == per_case)
            for (tree, name), aval in zip(names, avals, strict=True)
        ]
        structures = {tree: jax.tree.structure(example) for tree, example in examples.items()}
        return Arguments(structures, leaves)

    def taken(self, trees: Mapping[str, PyTree]) -> tuple[list[np.ndarray], int]:
        """Return copies of all arrays, in order, and the number of cases.

        Raises `TypeError` and `ValueError` as `Argument.taken` does, and `ValueError` for trees of
        another structure, different numbers of cases, or none at all.
        """
        leaves: list[Any] = []
        for name, structure in self.structures.items():
            given = jax.tree.structure(trees[name])
            if given != structure:
                raise ArgumentError(name, f"must be a tree of the structure {structure}", given)
            leaves += jax.tree.leaves(trees[name])
        arrays = [argument.taken(x) for argument, x in zip(self.leaves, leaves, strict=True)]
        counts = [
            (argument.name, len(array))
            for argument, array in zip(self.leaves, arrays, strict=True)
            if argument.per_case
        ]
        if not counts:
            raise ValueError("There must be at least one array of cases, but there is none.")
        first, count = counts[0]
        for name, number in counts:
            if number != count:
                raise ArgumentError(name, f"must have {count} cases, as `{first}` has", number)
        return arrays, count


class AlignedMemory:
    """Memory for machine code, aligned and initially zero."""

    def __init__(self, size: int):
        room = np.zeros(size + ALIGNMENT, np.uint8)
        skipped = -room.ctypes.data % ALIGNMENT
        self.bytes = room[skipped : skipped + size]
        self.address: int = self.bytes.ctypes.data


def addresses(arena: AlignedMemory, arrays: Sequence[np.ndarray]) -> ctypes.Array:
    """Return the `pointers` of an entry point; arena and arrays must outlive their use."""
    return (ctypes.c_void_p * (1 + len(arrays)))(
        arena.address, *(array.ctypes.data for array in arrays)
    )


def as_numbers(name: str, x: Any) -> np.ndarray:
    """Return `x` as an array of supported numbers, in this machine's byte order."""
    dtype = getattr(x, "dtype", None)
    if dtype is None or isinstance(dtype, np.dtype):  # and no type of JAX's own
        x = np.asarray(x)
        dtype = x.dtype.newbyteorder("=")
        if dtype.kind in KINDS and dtype.itemsize <= LARGEST:
            return x.astype(dtype, copy=False)
    raise TypeError(
        f"Argument `{name}` must hold real numbers of at most 64 bits, but got {dtype}."
    )
