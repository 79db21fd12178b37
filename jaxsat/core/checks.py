"""Checks and conversions used where an object is made, and nowhere else."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Inexact

from jaxsat.core.errors import ArgumentError
from jaxsat.core.inertia import require_known_inertia
from jaxsat.core.jax_internals import Tracer


def as_array(known: np.ndarray) -> Array:
    """A NumPy array as a JAX array of the default precision, without compiling a copy for it."""
    known = known.astype(jax.dtypes.canonicalize_dtype(known.dtype))  # which is a copy
    return jnp.asarray(known, known.dtype)  # with its type named, or XLA compiles the identity


def as_float(value: ArrayLike | list | tuple) -> Inexact[Array, "..."]:
    """Turn numbers into a floating-point JAX array whose type no later operation weakens."""
    if not any(isinstance(leaf, Array) for leaf in jax.tree.leaves(value)):
        known = np.asarray(value)
        if known.dtype.kind in "biu":
            known = known.astype(float)
        if known.dtype.kind in "fc":
            return as_array(known)
    array = jnp.asarray(value)
    inexact = jnp.issubdtype(array.dtype, jnp.inexact)
    return array.astype(array.dtype if inexact else float)


def as_optional_float(value: ArrayLike | list | tuple | None) -> Inexact[Array, "..."] | None:
    """The same, where None stands for something that is left out."""
    return None if value is None else as_float(value)


def concrete(value: ArrayLike) -> np.ndarray | None:
    """The value as a NumPy array, or `None` while it is being traced (then nothing is checked)."""
    return None if isinstance(value, Tracer) else np.asarray(value)


def numpy_if_known(*values: Array) -> tuple[Any, ...]:
    """`numpy` and the values as its arrays where all are known, else `jax.numpy` and the values.

    For what is also made once, of known numbers: JAX would compile every operation of it.
    """
    known = [concrete(value) for value in values]
    return (jnp, *values) if any(one is None for one in known) else (np, *known)


def require_finite(name: str, value: ArrayLike) -> None:
    """Raise `ArgumentError` unless every entry is finite."""
    known = concrete(value)
    if known is not None and not np.all(np.isfinite(known)):
        raise ArgumentError(name, "must be finite", known.tolist())


def require_positive(name: str, value: ArrayLike, *, zero_allowed: bool = False) -> None:
    """Raise `ArgumentError` unless every entry is positive (or zero, where that is allowed)."""
    known = concrete(value)
    if known is None:
        return
    good = known >= 0 if zero_allowed else known > 0
    if not np.all(good):
        kind = "zero or positive" if zero_allowed else "positive"
        raise ArgumentError(name, f"must be {kind}", known.tolist())


def require_counts(**counts: int | None) -> None:
    """Raise `ArgumentError` for a number of things that is below one; None is none at all."""
    for name, count in counts.items():
        if count is not None and count < 1:
            raise ArgumentError(name, "must be at least 1", count)


def require_directions(name: str, columns: ArrayLike) -> None:
    """Raise `ArgumentError` unless the shape is (3, m) with m >= 1 and no column is zero."""
    shape = np.shape(columns)
    if len(shape) != 2 or shape[0] != 3 or shape[1] < 1:
        raise ArgumentError(name, "must have shape (3, m) with at least one column", shape)
    require_finite(name, columns)
    known = concrete(columns)
    if known is not None and not np.all(np.any(known != 0, axis=0)):
        raise ArgumentError(name, "must have no column of zeros", known.tolist())


def require_inertia(name: str, inertia: Float[Array | np.ndarray, "3 3"]) -> None:
    """Raise `ArgumentError` unless the matrix is symmetric and positive definite."""
    known = concrete(inertia)
    if known is not None:
        require_known_inertia(name, known)


def all_positive(*values: ArrayLike) -> bool:
    """Whether all values are known and positive; a traced value counts as not known to be."""
    known = [concrete(value) for value in values]
    return all(value is not None and bool(np.all(value > 0)) for value in known)
