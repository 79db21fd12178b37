"""Rules of the operations of a function in `jax.numpy` for affine forms, and their corners.

Operations that move numbers have the rules of the compiler, for the places of the numbers.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import jax
import numpy as np

from jaxsat.compiler.rules.structural import MOVES
from jaxsat.core.errors import ArgumentError
from jaxsat.core.jax_internals import IDENTICAL
from jaxsat.core.jaxprs import Equation
from jaxsat.synthesis.enclosure import functions
from jaxsat.synthesis.enclosure.forms import (
    Form,
    Numbers,
    add,
    exact,
    multiply,
    negative,
    subtract,
    total,
)

Rule = Callable[..., Form | Sequence[Form]]
"""Forms of the results of an operation from its parameters by name, and its operands."""


def numbers_at(places: Sequence[np.ndarray], *forms: Form) -> list[Form]:
    """Return forms of the numbers at some places, which count through all forms together."""
    count = max(len(one.rows) for one in forms)
    flat = [one.rows.reshape(len(one.rows), math.prod(one.shape)) for one in forms]
    zeros = [np.zeros((count - len(one), one.shape[1])) for one in flat]
    rows = np.concatenate([np.concatenate(parts) for parts in zip(flat, zeros, strict=True)], 1)
    starts = max(one.starts for one in forms)
    return [Form(rows[:, one], starts) for one in places]


def moving_rule(equation: Equation) -> Rule:
    """Return the rule of an operation of `MOVES`, which only moves numbers."""
    shapes = [one.aval.shape for one in equation.inputs]
    ends = np.cumsum([0, *map(math.prod, shapes)])
    numbers = [
        np.arange(begin, end).reshape(shape)
        for begin, end, shape in zip(ends, ends[1:], shapes, strict=False)
    ]
    moved = MOVES[equation.name](equation, *numbers)
    places = [one.astype(int) for one in ([moved] if isinstance(moved, np.ndarray) else moved)]
    return lambda _, *forms: numbers_at(places, *forms)


def _products(parameters: Mapping, x: Form, y: Form) -> Form:
    """The general product of two arrays: batch, free and summed axes."""
    ((summed_x, summed_y), (batch_x, batch_y)) = parameters["dimension_numbers"]
    free_x = [axis for axis in range(len(x.shape)) if axis not in (*summed_x, *batch_x)]
    free_y = [axis for axis in range(len(y.shape)) if axis not in (*summed_y, *batch_y)]
    x = _transposed(x, (*batch_x, *free_x, *summed_x))
    y = _transposed(y, (*batch_y, *free_y, *summed_y))
    batch, rows = len(batch_x), y.rows
    place = 1 + batch
    rows = rows.reshape(*rows.shape[:place], *(1,) * len(free_x), *rows.shape[place:])
    left = x.rows
    place += len(free_x)
    left = left.reshape(*left.shape[:place], *(1,) * len(free_y), *left.shape[place:])
    products = multiply(Form(left, x.starts), Form(rows, y.starts))
    last = len(products.shape)
    return total(products, tuple(range(last - len(summed_x), last)))


def _transposed(form: Form, order: Sequence[int]) -> Form:
    return Form(form.rows.transpose(0, *(axis + 1 for axis in order)), form.starts)


def _extreme(function: Callable) -> Rule:
    """Return the rule of the largest or smallest number along axes."""

    def rule(parameters: Mapping, x: Form) -> Form:
        axes = parameters["axes"]
        others = [axis for axis in range(len(x.shape)) if axis not in axes]
        x = _transposed(x, (*others, *axes))
        shape = tuple(x.shape[: len(others)])
        parts = np.moveaxis(x.rows.reshape(len(x.rows), *shape, -1), -1, 0)
        extreme = Form(parts[0], x.starts)
        for part in parts[1:]:
            extreme = function(extreme, Form(part, x.starts))
        return extreme

    return rule


def _chosen(parameters: Mapping, truth: Form, *cases: Form) -> Form:
    if len(cases) != 2:
        raise ArgumentError("function", "must select between two cases", len(cases))
    return functions.choice(truth, *cases)


def _raised(parameters: Mapping, x: Form, y: Form) -> Form:
    if len(y.rows) > 2 or y.rest.any() or np.ptp(y.center):
        return functions.exponential(multiply(y, functions.logarithm(x)))
    return functions.power(x, float(y.center.flat[0]))


def _places(index: Form) -> np.ndarray:
    """Return an index, which must be constant."""
    if index.reach.any():
        raise ArgumentError("function", "must index arrays by constants")
    return index.center.astype(int)


def _gathered(parameters: Mapping, x: Form, index: Form) -> Form:
    count = math.prod(x.shape)
    places = jax.lax.gather(
        np.arange(count).reshape(x.shape),
        _places(index),
        parameters["dimension_numbers"],
        parameters["slice_sizes"],
        mode=parameters["mode"],
    )
    return numbers_at([np.asarray(places)], x)[0]


def _scattered(parameters: Mapping, x: Form, index: Form, new: Form) -> Form:
    """Some numbers replaced, by the places of all numbers in old and new ones together."""
    count, more = math.prod(x.shape), math.prod(new.shape)
    places = jax.lax.scatter(
        np.arange(count).reshape(x.shape),
        _places(index),
        np.arange(count, count + more).reshape(new.shape),
        parameters["dimension_numbers"],
        mode=parameters["mode"],
    )
    return numbers_at([np.asarray(places)], x, new)[0]


def _sliced(parameters: Mapping, x: Form, *starts: Form) -> Form:
    sizes = parameters["slice_sizes"]
    first = [int(_places(one)) for one in starts]
    ends = [
        min(max(at, 0), length - size)
        for at, length, size in zip(first, x.shape, sizes, strict=True)
    ]
    cuts = (slice(at, at + size) for at, size in zip(ends, sizes, strict=True))
    return Form(x.rows[(slice(None), *cuts)], x.starts)


def _plain(function: Callable[..., Form]) -> Rule:
    """Return the rule of an operation without parameters."""
    return lambda parameters, *forms: function(*forms)


_PLAIN: dict[str, Callable[..., Form]] = {
    "add": add,
    "add_any": add,
    "sub": subtract,
    "mul": lambda x, y: functions.square(x) if x is y else multiply(x, y),
    "neg": negative,
    "div": functions.quotient,
    "square": functions.square,
    "sqrt": functions.root,
    "rsqrt": lambda x: functions.power(x, -0.5),
    "exp": functions.exponential,
    "log": functions.logarithm,
    "log1p": lambda x: functions.logarithm(add(x, exact(1.0))),
    "expm1": lambda x: subtract(functions.exponential(x), exact(1.0)),
    "tanh": functions.hyperbolic_tangent,
    "logistic": functions.logistic,
    "sin": functions.sine,
    "cos": functions.cosine,
    "atan": functions.arctangent,
    "abs": functions.magnitude,
    "sign": functions.sign,
    "floor": functions.floor,
    "max": functions.larger,
    "min": functions.smaller,
    "clamp": lambda low, x, high: functions.smaller(functions.larger(x, low), high),
    "lt": functions.below,
    "le": functions.at_most,
    "gt": lambda x, y: functions.below(y, x),
    "ge": lambda x, y: functions.at_most(y, x),
    "eq": functions.equal,
    "ne": lambda x, y: functions.opposite(functions.equal(x, y)),
    "not": functions.opposite,
    "and": functions.conjunction,
    "or": functions.alternative,
    "is_finite": lambda x: exact(np.ones(x.shape)),
}

RULES: dict[str, Rule] = {
    **{name: _plain(function) for name, function in _PLAIN.items()},
    **{name: _plain(lambda x: x) for name in IDENTICAL},
    "convert_element_type": _plain(lambda x: x),
    "integer_pow": lambda parameters, x: functions.power(x, float(parameters["y"])),
    "pow": _raised,
    "select_n": _chosen,
    "dot_general": _products,
    "reduce_sum": lambda parameters, x: total(x, parameters["axes"]),
    "reduce_max": _extreme(functions.larger),
    "reduce_min": _extreme(functions.smaller),
    "gather": _gathered,
    "scatter": _scattered,
    "dynamic_slice": _sliced,
}
"""Rules of operations by the names of JAX's primitives, besides those that move numbers."""


def _not_apart(x: Form, y: Form) -> Numbers:
    return (x.lower < y.upper) & (y.lower < x.upper)


def _not_one_sided(x: Form) -> Numbers:
    return (x.lower <= 0) & (x.upper >= 0)


def _undecided(truth: Form, *_: Form) -> Numbers:
    return functions.is_possible(truth) & ~functions.is_certain(truth)


CORNERS: dict[str, Callable[..., Numbers]] = {
    "abs": _not_one_sided,
    "sign": _not_one_sided,
    "floor": lambda x: np.floor(x.lower) != np.floor(x.upper),
    "max": _not_apart,
    "min": _not_apart,
    "clamp": lambda low, x, high: _not_apart(low, x) | _not_apart(x, high),
    "select_n": _undecided,
    "reduce_max": lambda x: np.array(True),
    "reduce_min": lambda x: np.array(True),
    **{
        name: lambda x, y, compare=_PLAIN[name]: _undecided(compare(x, y))
        for name in ("lt", "le", "gt", "ge", "eq", "ne")
    },
}
"""Where operations by name are not smooth on their operands' sets."""
