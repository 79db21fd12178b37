"""Trees of arrays: one of two, strong types, halves of symmetric matrices, and computed once.

XLA for processors fuses operations into loops over a batch, and repeats what several loops need in
each of them where it holds that for cheap: sines, and the rates of a whole state for every row of a
concatenation. A call that it must not take apart (`apart`) is computed once.
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
    """Of two trees alike, `one` where `when` holds, else the `other`."""
    return jax.tree.map(lambda x, y: jnp.where(when, x, y), one, other)


def strong(tree):
    """The tree with the same numbers, none of a weak type: `jnp.array(0.1)` has one.

    A compiled function takes a weak type for another type, and would be compiled again for it.
    """
    return jax.tree.map(lambda x: x.astype(x.dtype) if getattr(x, "weak_type", False) else x, tree)


class Symmetric(eqx.Module):
    """A matrix that is equal to its transpose in all bits."""

    matrix: Float[Array, "n n"]


class _Half(eqx.Module):
    """The upper half of such a matrix, row by row."""

    elements: Float[Array, " half"]
    size: int = eqx.field(static=True)


def halved(tree: PyTree) -> PyTree:
    """A tree with the halves of its symmetric matrices in their places."""

    def half(x):
        if not isinstance(x, Symmetric):
            return x
        size = x.matrix.shape[0]
        return _Half(x.matrix[np.triu_indices(size)], size)

    return jax.tree.map(half, tree, is_leaf=lambda x: isinstance(x, Symmetric))


def restored(tree: PyTree) -> PyTree:
    """The tree that was halved."""

    def whole(x):
        return Symmetric(x.elements[_places(x.size)]) if isinstance(x, _Half) else x

    return jax.tree.map(whole, tree, is_leaf=lambda x: isinstance(x, _Half))


@once
def _places(size: int) -> Int[np.ndarray, "n n"]:
    """Where in a half each element of the matrix is."""
    places = np.zeros((size, size), int)
    rows, columns = np.triu_indices(size)
    places[rows, columns] = places[columns, rows] = np.arange(rows.size)
    return places


try:
    from jax.experimental.xla_metadata import set_xla_metadata
except ImportError:  # experimental
    set_xla_metadata = None


def apart(function: Callable[..., PyTree], *args: Any) -> PyTree:
    """`function(*args)`, computed once before what needs it rather than anew in every place.

    The function is a compiled one (`jax.jit`, `equinox.filter_jit`), best the same at every call.
    The wish is an attribute on the call; a version of XLA that does not know it takes a plain one.
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
