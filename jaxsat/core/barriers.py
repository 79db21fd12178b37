"""A compiler hint: what XLA computes once, and not again in every place that needs it.

XLA for processors fuses operations into loops over a batch, and repeats what several loops need in
each of them where it holds that for cheap: sines, and the rates of a whole state for every row of a
concatenation. A call that it is told not to take apart is computed once.
"""

from collections.abc import Callable
from typing import Any

import jax
from jaxtyping import PyTree

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
