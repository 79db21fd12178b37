"""Halves of symmetric matrices."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.trees import Symmetric, halved, restored


class _Memory(NamedTuple):
    number: jax.Array
    parts: dict


@pytest.mark.parametrize("size", [1, 2, 5, 8])
def test_a_tree_is_the_same_after_it_was_halved_and_restored(size):
    matrix = np.random.default_rng(size).normal(size=(size, size))
    memory = _Memory(
        jnp.array(3), {"covariance": Symmetric(jnp.array(matrix + matrix.T)), "no": None}
    )
    half = halved(memory)
    assert sum(leaf.size for leaf in jax.tree.leaves(half)) == 1 + size * (size + 1) // 2
    again = restored(half)
    assert jax.tree.structure(again) == jax.tree.structure(memory)
    jax.tree.map(np.testing.assert_array_equal, again, memory)


def test_trees_without_one_stay_as_they_are():
    tree = {"a": jnp.ones(3), "b": (None, 2.0)}
    assert jax.tree.structure(halved(tree)) == jax.tree.structure(tree)
    assert restored(tree)["a"] is tree["a"]
