"""Evaluates a jaxpr of basic operations with NumPy: IEEE arithmetic, subnormals, nothing fused."""

from collections.abc import Callable

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal


def _select_n(which: np.ndarray, *cases: np.ndarray) -> np.ndarray:
    return np.where(which, cases[1], cases[0])


def _shift_right_logical(x: np.ndarray, count: np.ndarray) -> np.ndarray:
    unsigned = f"u{np.asarray(x).dtype.name}"
    return (np.asarray(x).view(unsigned) >> np.asarray(count).astype(unsigned)).view(x.dtype)


_RULES: dict[str, Callable] = {
    "abs": np.abs,
    "add": np.add,
    "add_any": np.add,
    "and": np.bitwise_and,
    "div": np.divide,
    "dynamic_slice": lambda table, start: table[np.clip(start, 0, len(table) - 1)],
    "squeeze": lambda x: x,
    "eq": np.equal,
    "floor": np.floor,
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "lt": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.invert,
    "or": np.bitwise_or,
    "round": lambda x: np.rint(x),
    "select_n": _select_n,
    "shift_left": np.left_shift,
    "shift_right_arithmetic": np.right_shift,
    "shift_right_logical": _shift_right_logical,
    "sqrt": np.sqrt,
    "sub": np.subtract,
    "xor": np.bitwise_xor,
}


def evaluate(closed: ClosedJaxpr, *arguments: np.ndarray) -> list[np.ndarray]:
    """The results of a jaxpr of scalars, elementwise over arrays."""
    with np.errstate(all="ignore"):
        return _evaluate(closed.jaxpr, closed.consts, arguments)


def _evaluate(jaxpr: Jaxpr, consts, arguments) -> list[np.ndarray]:
    values = dict(zip((*jaxpr.constvars, *jaxpr.invars), (*consts, *arguments), strict=True))

    def read(atom):
        return np.asarray(atom.val) if isinstance(atom, Literal) else values[atom]

    for equation in jaxpr.eqns:
        inputs = [read(atom) for atom in equation.invars]
        results = _apply(equation, inputs)
        values.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in jaxpr.outvars]


def _apply(equation, inputs: list[np.ndarray]) -> list[np.ndarray]:
    name, params = equation.primitive.name, equation.params
    if name == "cond":
        results = [_evaluate(b.jaxpr, b.consts, inputs[1:]) for b in params["branches"]]
        return [_select_n(inputs[0], *cases) for cases in zip(*results, strict=True)]
    if name in ("jit", "pjit", "closed_call"):
        return _evaluate(params["jaxpr"].jaxpr, params["jaxpr"].consts, inputs)
    if name in ("convert_element_type", "bitcast_convert_type"):
        dtype = np.dtype(params["new_dtype"])
        cast = name == "convert_element_type"
        return [inputs[0].astype(dtype) if cast else np.asarray(inputs[0]).view(dtype)]
    if name == "broadcast_in_dim":
        return [inputs[0]]
    return [_RULES[name](*inputs)]


def scalar_program(function: Callable, *dtypes) -> ClosedJaxpr:
    return jax.make_jaxpr(function)(*(np.zeros((), dtype) for dtype in dtypes))
