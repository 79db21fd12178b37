"""Primitives that only call a jaxpr of their own: what they call is lowered in their place."""

from jaxsat.engine.native.builder import Builder
from jaxsat.engine.native.lowering import Elements, lower, lower_open, lowers
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
    if hasattr(inner, "consts"):
        return lower(b, inner, arrays)
    return lower_open(b, inner, [], arrays)
