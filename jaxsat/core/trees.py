"""Trees of arrays: selection, strong types, halves of symmetric matrices, and sharing of results.

XLA on CPUs fuses operations into loops over a batch, and recomputes operations shared by several
loops where it deems them cheap: sines, and the rates of a whole state for every row of a
concatenation. A call marked by `apart` is computed once.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.core.array_types import BoolScalar
from jaxsat.core.once import once


def choose(when: BoolScalar, one, other):
    """Return `one` where `when` holds, else the `other`, for two trees of equal structure."""
    return jax.tree.map(lambda x, y: jnp.where(when, x, y), one, other)


def strong(tree):
    """Return the tree with the same numbers, none of a weak type such as `jnp.array(0.1)`.

    A weak type is another type for a compiled function, which would be compiled again for it.
    """
    return jax.tree.map(lambda x: x.astype(x.dtype) if getattr(x, "weak_type", False) else x, tree)


class Symmetric(eqx.Module):
    """A matrix that is equal to its transpose in all bits."""

    matrix: Float[Array, "n n"]


class _Half(eqx.Module):
    """Upper half of a symmetric matrix, row by row."""

    elements: Float[Array, " half"]
    size: int = eqx.field(static=True)


def halved(tree: PyTree) -> PyTree:
    """Return a tree with the symmetric matrices replaced by their halves."""

    def half(x):
        if not isinstance(x, Symmetric):
            return x
        size = x.matrix.shape[0]
        return _Half(x.matrix[np.triu_indices(size)], size)

    return jax.tree.map(half, tree, is_leaf=lambda x: isinstance(x, Symmetric))


def restored(tree: PyTree) -> PyTree:
    """Return the tree with the halves replaced by their symmetric matrices."""

    def whole(x):
        return Symmetric(x.elements[_places(x.size)]) if isinstance(x, _Half) else x

    return jax.tree.map(whole, tree, is_leaf=lambda x: isinstance(x, _Half))


@once
def _places(size: int) -> Int[np.ndarray, "n n"]:
    """Return the index in a half of each element of the matrix."""
    places = np.zeros((size, size), int)
    rows, columns = np.triu_indices(size)
    places[rows, columns] = places[columns, rows] = np.arange(rows.size)
    return places


try:
    from jax.experimental.xla_metadata import set_xla_metadata
except ImportError:  # experimental
    set_xla_metadata = None


def apart(function: Callable[..., PyTree], *args: Any) -> PyTree:
    """Return `function(*args)`, computed once rather than again in every place of use.

    The function is a compiled one (`jax.jit`, `equinox.filter_jit`), best the same at every call.
    The request is an attribute of the call; a version of XLA without it makes an ordinary call.
    """
    outputs = function(*args)
    leaves, tree = jax.tree.flatten(outputs)
    if set_xla_metadata is None or not leaves or jax.default_backend() != "cpu":
        return outputs
    try:
        marked = set_xla_metadata(leaves[0], inlineable="false")
    except TypeError:  # before JAX had it for arrays
        return outputs
    return jax.tree.unflatten(tree, [marked, *leaves[1:]])
