"""Primitives that only call a jaxpr of their own: what they call is lowered in their place."""

from collections.abc import Sequence

from jaxsat.engine.native.builder import Builder
from jaxsat.engine.native.dead_code import without_dead_code
from jaxsat.engine.native.ir import Function, Value
from jaxsat.engine.native.lowering import (
    Elements,
    arrays_of,
    lower,
    lower_open,
    lowers,
    scalars_of,
)
from jaxsat.engine.native.uniformity import INNER


@lowers(
    "jit",
    "pjit",
    "closed_call",
    "core_call",
    "checkpoint",
    "remat",
    "remat2",
    "custom_jvp_call",
    "custom_vjp_call",
    "custom_vjp_call_jaxpr",
    "custom_lin",
)
def _call(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    inner = next(eqn.params[key] for key in INNER if key in eqn.params)
    if id(inner) in b.repeated:
        return _shared(b, eqn, inner, arrays)
    if hasattr(inner, "consts"):
        return lower(b, inner, arrays)
    return lower_open(b, inner, [], arrays)


def _shared(b: Builder, eqn, inner, arrays: Sequence[Elements]) -> list[Elements]:
    """A call of one function for all that is called several times, known arguments folded in."""
    args = scalars_of(arrays)
    known = tuple(
        (x.dtype.char, x.uniform) if isinstance(x, Value) else (x.dtype.char, x.tobytes())
        for x in args
    )
    given = [x for x in args if isinstance(x, Value)]
    key = (id(inner), known)
    if key not in b.functions:
        params = [Value(x.dtype, x.uniform) for x in given]
        rest = iter(params)
        inside = [next(rest) if isinstance(x, Value) else x for x in args]
        body = Builder(like=b)
        body.functions, body.repeated = b.functions, b.repeated
        shapes = [array.shape for array in arrays]
        results = scalars_of(lower(body, inner, arrays_of(inside, shapes)))
        label = f"{eqn.params.get('name', 'shared')}.{len(b.functions)}"
        b.functions[key] = without_dead_code(Function(label, params, body.block, results))
    found = b.call(b.functions[key], given)
    return arrays_of(found, [var.aval.shape for var in eqn.outvars])
