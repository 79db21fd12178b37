"""Symmetric matrices in memories, of which a loop carries one half from sample to sample."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.core.once import once


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
    found = np.zeros((size, size), int)
    rows, columns = np.triu_indices(size)
    found[rows, columns] = found[columns, rows] = np.arange(rows.size)
    return found
