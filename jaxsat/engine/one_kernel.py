"""A batch's program as one piece of machine code, where XLA for processors can make it so.

XLA for processors runs a compiled program operation by operation, each a call of its own (a
"thunk") that costs some tenths of a microsecond and, beyond a few hundred bytes, a turn through a
queue of threads. Small loops it compiles as a whole instead, but it takes them for small from the
bytes they touch, a thousand or so. The attribute by which it marks them to itself can be set from
outside. It is a wish: where it means nothing, the program is an ordinary call.
"""

from collections.abc import Callable
from typing import Any

import jax
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend import core
from jaxtyping import PyTree

import os
WIDEST = int(os.environ.get("WIDEST","512"))


def as_one_kernel(function: Callable[[], PyTree], lanes: int) -> PyTree:
    """What `function` gives, computed in one piece where that is possible and pays."""
    if lanes > WIDEST or jax.default_backend() != "cpu":
        return function()
    closed, shape = jax.make_jaxpr(function, return_shape=True)()
    inputs = closed.consts

    def whole(*inputs):
        # an input that is not used would be no part of the kernel, and XLA would break down
        return core.jaxpr_as_fun(core.ClosedJaxpr(closed.jaxpr, inputs))(), inputs

    outputs, inputs = jax.jit(whole)(*inputs)
    first = set_xla_metadata(outputs[0], inlineable="false", xla_cpu_small_call="true")
    outputs, inputs = jax.lax.optimization_barrier(([first, *outputs[1:]], inputs))
    return jax.tree.unflatten(jax.tree.structure(shape), outputs)
