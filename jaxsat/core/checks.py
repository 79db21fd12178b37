"""Checks and conversions of arguments where an object is made."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Inexact

from jaxsat.core.errors import ArgumentError
from jaxsat.core.inertia import require_known_inertia
from jaxsat.core.jax_internals import Tracer

Numbers = ArrayLike | list | tuple
Converter = Callable[[Numbers], Inexact[Array, "..."]]


def as_array(numbers: np.ndarray) -> Array:
    """Return a NumPy array as a JAX array of the default precision, without compiling a copy."""
    numbers = numbers.astype(jax.dtypes.canonicalize_dtype(numbers.dtype))  # which is a copy
    return jnp.asarray(numbers, numbers.dtype)  # with its type named, or XLA compiles the identity


def as_float(value: Numbers) -> Inexact[Array, "..."]:
    """Convert numbers to a floating-point JAX array with a strong type."""
    if not any(isinstance(leaf, Array) for leaf in jax.tree.leaves(value)):
        numbers = np.asarray(value)
        if numbers.dtype.kind in "biu":
            numbers = numbers.astype(float)
        if numbers.dtype.kind in "fc":
            return as_array(numbers)
    array = jnp.asarray(value)
    inexact = jnp.issubdtype(array.dtype, jnp.inexact)
    return array.astype(array.dtype if inexact else float)


def as_optional_float(value: Numbers | None) -> Inexact[Array, "..."] | None:
    """Convert as `as_float`, with None for an omitted value."""
    return None if value is None else as_float(value)


def concrete(value: ArrayLike) -> np.ndarray | None:
    """Return the value as a NumPy array, or `None` while traced (no checks are possible then)."""
    return None if isinstance(value, Tracer) else np.asarray(value)


def numpy_if_known(*values: Array) -> tuple[Any, ...]:
    """Return `numpy` and NumPy arrays if all values are concrete, else `jax.numpy` and the values.

    For objects made once of concrete numbers, for which JAX would compile each operation.
    """
    arrays = [concrete(value) for value in values]
    return (jnp, *values) if any(one is None for one in arrays) else (np, *arrays)


def require_finite(name: str, value: ArrayLike) -> None:
    """Raise `ArgumentError` unless every entry is finite."""
    numbers = concrete(value)
    if numbers is not None and not np.all(np.isfinite(numbers)):
        raise ArgumentError(name, "must be finite", numbers.tolist())


def require_positive(name: str, value: ArrayLike, *, zero_allowed: bool = False) -> None:
    """Raise `ArgumentError` unless every entry is positive (or zero, where that is allowed)."""
    numbers = concrete(value)
    if numbers is None:
        return
    good = numbers >= 0 if zero_allowed else numbers > 0
    if not np.all(good):
        kind = "zero or positive" if zero_allowed else "positive"
        raise ArgumentError(name, f"must be {kind}", numbers.tolist())


def finite(name: str) -> Converter:
    """Return the converter of a field of this name to finite floating-point numbers."""

    def convert(value: Numbers) -> Inexact[Array, "..."]:
        array = as_float(value)
        require_finite(name, array)
        return array

    return convert


def positive(name: str, *, zero_allowed: bool = False) -> Converter:
    """Return the converter of a field of this name to positive floating-point numbers."""

    def convert(value: Numbers) -> Inexact[Array, "..."]:
        array = as_float(value)
        require_positive(name, array, zero_allowed=zero_allowed)
        return array

    return convert


def not_negative(name: str) -> Converter:
    """Return the converter of a field of this name to numbers that are positive or zero."""
    return positive(name, zero_allowed=True)


def require_counts(**counts: int | None) -> None:
    """Raise `ArgumentError` for a count below one; None is not checked."""
    for name, count in counts.items():
        if count is not None and count < 1:
            raise ArgumentError(name, "must be at least 1", count)


def require_directions(name: str, columns: ArrayLike) -> None:
    """Raise `ArgumentError` unless the shape is (3, m) with m >= 1 and no column is zero."""
    shape = np.shape(columns)
    if len(shape) != 2 or shape[0] != 3 or shape[1] < 1:
        raise ArgumentError(name, "must have shape (3, m) with at least one column", shape)
    require_finite(name, columns)
    numbers = concrete(columns)
    if numbers is not None and not np.all(np.any(numbers != 0, axis=0)):
        raise ArgumentError(name, "must have no column of zeros", numbers.tolist())


def require_inertia(name: str, inertia: Float[Array | np.ndarray, "3 3"]) -> None:
    """Raise `ArgumentError` unless the matrix is symmetric and positive definite."""
    matrix = concrete(inertia)
    if matrix is not None:
        require_known_inertia(name, matrix)


def all_positive(*values: ArrayLike) -> bool:
    """Whether all values are concrete and positive; a traced value makes it false."""
    arrays = [concrete(value) for value in values]
    return all(value is not None and bool(np.all(value > 0)) for value in arrays)
