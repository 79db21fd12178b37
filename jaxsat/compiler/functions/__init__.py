"""Elementary functions of the compiled engine, in basic operations alone.

Each is plain `jax.numpy` code on doubles, of one number or elementwise: additions, products,
quotients, square roots, comparisons, selections and operations on bits; `lax.cond` only around
rare wide cases. Errors stay below 2 units in the last place (4 for pow and erf_inv) over the whole
domain, special values are NumPy's. 32-bit floats are computed in 64 bits and rounded once.

`FUNCTIONS` maps the names of JAX's primitives to them; `program` gives the jaxpr of one.
"""

from collections.abc import Callable
from functools import wraps

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import DTypeLike

from jaxsat.compiler.functions.error_function import erf, erf_inv, erfc, near_erf_inv
from jaxsat.compiler.functions.exponential import exp, exp2, expm1, log, log1p, logistic
from jaxsat.compiler.functions.hyperbolic import acosh, asinh, atanh, cosh, sinh, tanh
from jaxsat.compiler.functions.power import cbrt, pow
from jaxsat.compiler.functions.trigonometric import (
    acos,
    asin,
    atan,
    atan2,
    cos,
    near_atan2,
    near_sincos,
    sin,
    sincos,
    tan,
)
from jaxsat.core.jaxprs import Jaxpr, jaxpr_of
from jaxsat.core.once import once


def _of_any_float(function: Callable) -> Callable:
    """Return the function on doubles for any real arguments, its result in the first one's type."""

    @wraps(function)
    def converted(*arguments: jax.Array) -> jax.Array | tuple[jax.Array, ...]:
        dtype = jnp.result_type(arguments[0])
        values = function(*(jnp.asarray(a).astype(jnp.float64) for a in arguments))
        return jax.tree.map(lambda x: x if x.dtype == bool else x.astype(dtype), values)

    return converted


FUNCTIONS: dict[str, Callable] = {
    function.__name__: _of_any_float(function)
    for function in (
        acos, acosh, asin, asinh, atan, atan2, atanh, cbrt, cos, cosh, erf, erf_inv, erfc, exp,
        exp2, expm1, log, log1p, logistic, near_atan2, near_erf_inv, near_sincos, pow, sin,
        sincos, sinh, tan, tanh,
    )
}  # fmt: skip


@once
def program(name: str, *dtypes: DTypeLike) -> Jaxpr:
    """Return the jaxpr of `FUNCTIONS[name]` for one number of each type.

    It is traced with 64-bit types, in which it computes, whatever the caller's setting.
    """
    with jax.enable_x64(True):
        return jaxpr_of(FUNCTIONS[name], *(np.zeros((), dtype) for dtype in dtypes))
