"""What is done to edge values: for every primitive of numbers, its uses in JAX and in NumPy."""

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import scipy.special
from jax import lax
from jax.extend.core.primitives import add_jaxvals_p, eq_to_p, le_to_p, lt_to_p

from compiler.edge_values import ALL, BOOLS, FLOATS, MISSING, NUMBERS, SIGNED, WHOLE
from jaxsat.core import trigonometry

EVEN = lax.RoundingMethod.TO_NEAREST_EVEN
ULPS, XLA_ULPS = 4, 64
"""Elementary functions may be so far from NumPy's and from XLA's, whose exp2 alone errs by 41."""


@dataclass(frozen=True)
class Edge:
    """A function of one or two numbers of these types.

    `ieee` gives in NumPy what XLA does not: results of subnormal numbers. `close` tells that two
    right results may differ by a few units in the last place. `second` is the second number's
    type if it is another; `xla` is computed in place of a primitive that XLA has for some numbers.
    """

    function: Callable
    dtypes: tuple[np.dtype, ...]
    ieee: Callable | None = None
    arity: int = 2
    close: bool = False
    second: np.dtype | None = None
    xla: Callable | None = None


def _one(function, dtypes, ieee=None, **options) -> Edge:
    return Edge(function, dtypes, ieee, 1, **options)


def _of_floats(function, ieee) -> list[Edge]:
    return [_one(function, FLOATS, ieee, close=True)]


def _away_from_zero(x):
    return np.copysign(np.floor(np.abs(x) + 0.5), x)  # for numbers below one


def _reduced(bits):
    return lambda x: lax.reduce_precision(x, *bits)


def _converted(dtype):
    return lambda x: lax.convert_element_type(x, dtype)


def _as_type(dtype):
    return lambda x: x != 0 if dtype.kind == "b" else x.astype(dtype)


def _bits_as(dtype):
    return lambda x: lax.bitcast_convert_type(x, dtype)


def _same_width(dtype):
    return [np.dtype(f"{kind}{dtype.itemsize}") for kind in "iu"]


def _which(number, x, y):
    return lax.select_n(number, x, y, x + y)


def _logistic(x):
    return 1 / (1 + np.exp(-x))


def _in_total_order(comparison):
    return lambda x, y: comparison(_ordered_bits(x), _ordered_bits(y))


def _ordered_bits(x):
    bits = x.view(f"i{x.dtype.itemsize}")
    return np.where(bits < 0, np.iinfo(bits.dtype).min - bits - 1, bits)


def _inverse_error_function(x):
    return np.copysign(scipy.special.erfinv(x), x)


def _two(function, dtypes, ieee=None, **options) -> list[Edge]:
    return [Edge(function, dtypes, ieee, **options)]


def _later(name, edges) -> dict[str, list[Edge]]:
    """Those of a primitive that not every JAX has."""
    return {} if name in MISSING else {name: edges(getattr(lax, name))}


ELEMENTWISE: dict[str, list[Edge]] = {
    "abs": [_one(lax.abs, FLOATS + SIGNED, np.abs)],
    "neg": [_one(lax.neg, NUMBERS, np.negative)],
    "sign": [_one(lax.sign, NUMBERS, np.sign)],
    "floor": [_one(lax.floor, FLOATS, np.floor)],
    "ceil": [_one(lax.ceil, FLOATS, np.ceil)],
    "round": [
        _one(lax.round, FLOATS, _away_from_zero),
        _one(lambda x: lax.round(x, EVEN), FLOATS, np.rint),
    ],
    "sqrt": [_one(lax.sqrt, FLOATS, np.sqrt)],
    "rsqrt": _of_floats(lax.rsqrt, lambda x: 1 / np.sqrt(x)),
    "square": [_one(lax.square, NUMBERS, np.square)],
    "integer_pow": [
        *(_one(lambda x, y=y: lax.integer_pow(x, y), NUMBERS, lambda x, y=y: x**y, close=y > 3)
          for y in (2, 3, 7)),
        *(_one(lambda x, y=y: lax.integer_pow(x, y), FLOATS, lambda x, y=y: 1 / x**-y, close=True)
          for y in (-1, -2, -5)),
    ],
    "is_finite": [_one(lax.is_finite, FLOATS, np.isfinite)],
    "not": [_one(lax.bitwise_not, WHOLE + BOOLS)],
    "population_count": [_one(lax.population_count, WHOLE)],
    "clz": [_one(lax.clz, WHOLE)],
    "reduce_precision": [
        _one(_reduced(bits), FLOATS, lambda x: np.copysign(x.dtype.type(0), x))
        for bits in ((5, 10), (7, 7), (4, 3), (2, 2))
    ],
    "convert_element_type": [_one(_converted(to), ALL, _as_type(to)) for to in ALL],
    "bitcast_convert_type": [
        _one(_bits_as(to), (dtype,), lambda x, to=to: x.view(to))
        for dtype in NUMBERS for to in _same_width(dtype) if to != dtype
    ],
    "copy": [_one(lambda x: lax.optimization_barrier(jnp.copy(x)), ALL, np.array)],
    "optimization_barrier": [_one(lax.optimization_barrier, ALL, np.array)],
    "add": _two(lax.add, NUMBERS, np.add),
    "add_any": _two(add_jaxvals_p.bind, NUMBERS, np.add),
    "sub": _two(lax.sub, NUMBERS, np.subtract),
    "mul": _two(lax.mul, NUMBERS, np.multiply),
    "div": _two(lax.div, NUMBERS, np.divide),
    "rem": _two(lax.rem, NUMBERS, np.fmod),
    "max": _two(lax.max, ALL, np.maximum),
    "min": _two(lax.min, ALL, np.minimum),
    "clamp": [
        Edge(lambda x, y: lax.clamp(x, y, x), NUMBERS,
             lambda x, y: np.minimum(np.maximum(x, y), x)),
        Edge(lambda x, y: lax.clamp(jnp.zeros_like(x), x, y), NUMBERS,
             lambda x, y: np.minimum(np.maximum(x, 0), y)),
    ],
    "lt": _two(lax.lt, ALL, np.less),
    "le": _two(lax.le, ALL, np.less_equal),
    "gt": _two(lax.gt, ALL, np.greater),
    "ge": _two(lax.ge, ALL, np.greater_equal),
    "eq": _two(lax.eq, ALL, np.equal),
    "ne": _two(lax.ne, ALL, np.not_equal),
    "eq_to": _two(eq_to_p.bind, NUMBERS, _in_total_order(np.equal)),
    "le_to": _two(le_to_p.bind, NUMBERS, _in_total_order(np.less_equal)),
    "lt_to": _two(lt_to_p.bind, NUMBERS, _in_total_order(np.less)),
    "and": _two(lax.bitwise_and, WHOLE + BOOLS),
    "or": _two(lax.bitwise_or, WHOLE + BOOLS),
    "xor": _two(lax.bitwise_xor, WHOLE + BOOLS),
    "shift_left": _two(lax.shift_left, WHOLE),
    "shift_right_logical": _two(lax.shift_right_logical, WHOLE),
    "shift_right_arithmetic": _two(lax.shift_right_arithmetic, WHOLE),
    **_later("one_minus_square", lambda function: [
        _one(function, NUMBERS, lambda x: (1 + x) * (1 - x), close=True),
    ]),
    "nextafter": _two(lax.nextafter, FLOATS, np.nextafter),
    "select_n": [
        Edge(lambda x, y: lax.select_n(lax.lt(x, y), x, y), ALL,
             lambda x, y: np.where(x < y, y, x)),
        Edge(lambda x, y: _which(y, x, x + 1), (np.dtype(np.int32),)),
    ],
    "atan2": _two(lax.atan2, FLOATS, np.arctan2, close=True),
    "pow": [
        Edge(lax.pow, FLOATS, np.power, close=True),
        Edge(lax.pow, FLOATS, np.power, close=True, second=np.dtype(np.int8)),
        Edge(lax.pow, FLOATS[:1], np.power, close=True, second=np.dtype(np.int32)),
    ],
    "acos": _of_floats(lax.acos, np.arccos),
    "acosh": _of_floats(lax.acosh, np.arccosh),
    "asin": _of_floats(lax.asin, np.arcsin),
    "asinh": _of_floats(lax.asinh, np.arcsinh),
    "atan": _of_floats(lax.atan, np.arctan),
    "atanh": _of_floats(lax.atanh, np.arctanh),
    "cbrt": _of_floats(lax.cbrt, np.cbrt),
    "cos": _of_floats(lax.cos, np.cos),
    "jaxsat_cos": [_one(trigonometry.cos, FLOATS, np.cos, close=True, xla=lax.cos)],
    "cosh": _of_floats(lax.cosh, np.cosh),
    "erf": _of_floats(lax.erf, scipy.special.erf),
    "erf_inv": _of_floats(lax.erf_inv, _inverse_error_function),
    "erfc": _of_floats(lax.erfc, scipy.special.erfc),
    "exp": _of_floats(lax.exp, np.exp),
    "exp2": _of_floats(lax.exp2, np.exp2),
    "expm1": _of_floats(lax.expm1, np.expm1),
    "log": _of_floats(lax.log, np.log),
    "log1p": _of_floats(lax.log1p, np.log1p),
    **_later("log2", lambda function: _of_floats(function, np.log2)),
    "logistic": _of_floats(lax.logistic, _logistic),
    "sin": _of_floats(lax.sin, np.sin),
    "jaxsat_sin": [_one(trigonometry.sin, FLOATS, np.sin, close=True, xla=lax.sin)],
    "sinh": _of_floats(lax.sinh, np.sinh),
    "tan": _of_floats(lax.tan, np.tan),
    "tanh": _of_floats(lax.tanh, np.tanh),
}  # fmt: skip
