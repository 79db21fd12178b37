"""Evaluates a jaxpr of basic operations with NumPy: IEEE arithmetic, subnormals, nothing fused."""

from collections.abc import Callable

import numpy as np

from jaxsat.core.jax_internals import CALL
from jaxsat.core.jaxprs import Jaxpr, Literal, jaxpr_of


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


def evaluate(jaxpr: Jaxpr, *arguments: np.ndarray) -> list[np.ndarray]:
    """The results of a jaxpr of scalars, elementwise over arrays."""
    with np.errstate(all="ignore"):
        return _evaluate(jaxpr, arguments)


def _evaluate(jaxpr: Jaxpr, arguments) -> list[np.ndarray]:
    values = dict(jaxpr.constants) | dict(zip(jaxpr.inputs, arguments, strict=True))

    def read(atom):
        return np.asarray(atom.value) if isinstance(atom, Literal) else values[atom]

    for equation in jaxpr.equations:
        inputs = [read(atom) for atom in equation.inputs]
        results = _apply(equation, inputs)
        values.update(zip(equation.outputs, results, strict=True))
    return [read(atom) for atom in jaxpr.outputs]


def _apply(equation, inputs: list[np.ndarray]) -> list[np.ndarray]:
    name, parameters = equation.name, equation.parameters
    if name == "cond":
        results = [_evaluate(branch, inputs[1:]) for branch in parameters["branches"]]
        return [_select_n(inputs[0], *cases) for cases in zip(*results, strict=True)]
    if name == CALL:
        return _evaluate(parameters["body"], inputs)
    if name in ("convert_element_type", "bitcast_convert_type"):
        dtype = np.dtype(parameters["new_dtype"])
        cast = name == "convert_element_type"
        return [inputs[0].astype(dtype) if cast else np.asarray(inputs[0]).view(dtype)]
    if name == "broadcast_in_dim":
        return [inputs[0]]
    return [_RULES[name](*inputs)]


def scalar_program(function: Callable, *dtypes) -> Jaxpr:
    return jaxpr_of(function, *(np.zeros((), dtype) for dtype in dtypes))
