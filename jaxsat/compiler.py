"""Wishes to XLA about which parts of a program become one piece of machine code, and which do not.

XLA for processors fuses operations into loops over a batch, and runs every loop as a call of its
own. Two things cost time there. What several loops need is repeated in each of them where XLA holds
it for cheap: sines, and the rates of a whole state for every row of a concatenation. And each call
takes some tenths of a microsecond, more where its arrays are longer than a few cache lines, so
that a small batch waits for calls more than for arithmetic.

Both wishes are attributes on a call in the program. They change no number that it computes but for
rounding; a version of XLA that does not know them takes an ordinary call.
"""

import inspect
from collections.abc import Callable
from typing import Any

import jax
import jaxlib.version
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend import core
from jaxtyping import PyTree

WIDEST = 96
"""Cases in a batch up to which one piece of code pays; wider ones are faster loop by loop."""

TESTED = ((0, 10),)
"""Versions of jaxlib with which programs of the primitives below were compiled in one piece."""

_COMPILED_WHOLE = """
abs acos add add_any and argmax argmin asin atan atan2 bitcast_convert_type broadcast_in_dim
cbrt ceil clamp concatenate cond convert_element_type copy cos cosh custom_jvp_call
custom_vjp_call div dot_general dynamic_slice dynamic_update_slice eq erf erf_inv exp exp2 expm1
floor gather ge gt integer_pow iota is_finite jit le log log1p logistic lt max min mul ne neg
not optimization_barrier or pad pmax pow reduce_and reduce_max reduce_min reduce_or reduce_prod
reduce_sum rem remat2 reshape rev round rsqrt scan select_n shift_left shift_right_arithmetic
shift_right_logical sign sin sinh slice split sqrt square squeeze stack stop_gradient sub tan
tanh transpose unstack while xla_metadata_value xor
"""
COMPILED_WHOLE = frozenset(_COMPILED_WHOLE.split())
"""Primitives known to compile so. XLA itself does not check: it breaks down over sorts, scatters,
Fourier transforms and whatever calls a library, in some versions with the whole process."""


def apart(function: Callable[..., PyTree], *args: Any) -> PyTree:
    """`function(*args)`, computed once before what needs it rather than anew in every place.

    The function is a compiled one (`jax.jit`, `equinox.filter_jit`), best the same at every call.
    """
    outputs = function(*args)
    return _marked(outputs, inlineable="false") if jax.default_backend() == "cpu" else outputs


def in_one_piece(function: Callable[[], PyTree], lanes: int) -> PyTree:
    """`function()` of a batch of so many cases, as one piece of code where that pays.

    It may close over traced arrays.
    """
    if lanes > WIDEST or jax.default_backend() != "cpu":
        return function()
    closed, shape = jax.make_jaxpr(function, return_shape=True)()
    if not compiles_whole(closed.jaxpr):
        return jax.tree.unflatten(jax.tree.structure(shape), core.jaxpr_as_fun(closed)())

    def whole(*inputs):
        # XLA breaks down over an input that nothing uses, so all are outputs too
        return core.jaxpr_as_fun(core.ClosedJaxpr(closed.jaxpr, inputs))(), inputs

    called = jax.jit(whole)(*closed.consts)
    called = _marked(called, inlineable="false", xla_cpu_small_call="true")
    outputs, _ = jax.lax.optimization_barrier(called)  # or JAX would drop the outputs not used
    return jax.tree.unflatten(jax.tree.structure(shape), outputs)


def compiles_whole(jaxpr: core.Jaxpr) -> bool:
    """Whether this XLA is known to compile all that the program holds in one piece."""
    tested = jaxlib.version.__version_info__[:2] in TESTED
    return tested and primitives(jaxpr) <= COMPILED_WHOLE


def primitives(jaxpr: core.Jaxpr) -> set[str]:
    """Names of the primitives in a program and in the programs inside it."""
    found = set()
    for eqn in jaxpr.eqns:
        found.add(eqn.primitive.name)
        for value in eqn.params.values():
            for inner in value if isinstance(value, tuple | list) else [value]:
                inner = getattr(inner, "jaxpr", inner)
                if isinstance(inner, core.Jaxpr):
                    found |= primitives(inner)
    return found


def _marked(outputs: PyTree, **attributes: str) -> PyTree:
    """The outputs of a call, which has these attributes from now on."""
    if "x" not in inspect.signature(set_xla_metadata).parameters:  # before JAX had it for arrays
        return outputs
    leaves, tree = jax.tree.flatten(outputs)
    marked = [set_xla_metadata(leaves[0], **attributes)] if leaves else []
    return jax.tree.unflatten(tree, [*marked, *leaves[1:]])
