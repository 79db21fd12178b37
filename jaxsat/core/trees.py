"""Trees of arrays: one of two, and one whose types nothing weakens."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


def choose(when: Bool[Array, ""], one, other):
    """Of two trees alike, `one` where `when` holds, else the `other`."""
    return jax.tree.map(lambda x, y: jnp.where(when, x, y), one, other)


def strong(tree):
    """The tree with the same numbers, none of a weak type: `jnp.array(0.1)` has one.

    A compiled function takes a weak type for another type, and would be compiled again for it.
    """
    return jax.tree.map(lambda x: x.astype(x.dtype) if getattr(x, "weak_type", False) else x, tree)
