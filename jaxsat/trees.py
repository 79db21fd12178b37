"""One of two trees of arrays."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


def choose(when: Bool[Array, ""], one, other):
    """Of two trees alike, `one` where `when` holds, else the `other`."""
    return jax.tree.map(lambda x, y: jnp.where(when, x, y), one, other)
