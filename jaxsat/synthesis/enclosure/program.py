"""A function in `jax.numpy`, evaluated for affine forms."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxsat.core.errors import ArgumentError
from jaxsat.core.jax_internals import IDENTICAL, summary_of
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, jaxpr_of
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
    unbounded,
)

Rule = Callable[..., Form | Sequence[Form]]
"""Forms of the results of an operation from its parameters by name, and its operands."""


def _moved(move: Callable) -> Rule:
    """Return the rule of an operation that moves numbers, from one for all rows of forms."""

    def rule(given: Mapping, *forms: Form) -> Form:
        count = max(len(one.rows) for one in forms)
        zeros = [np.zeros((count - len(one.rows), *one.shape)) for one in forms]
        rows = [np.concatenate([one.rows, more]) for one, more in zip(forms, zeros, strict=True)]
        return Form(move(given, *rows), max(one.starts for one in forms))

    return rule


def _cut(given: Mapping, rows: np.ndarray) -> np.ndarray:
    starts, ends = given["start_indices"], given["limit_indices"]
    strides = given.get("strides") or (1,) * len(starts)
    return rows[(slice(None), *map(slice, starts, ends, strides))]


def _spread(given: Mapping, rows: np.ndarray) -> np.ndarray:
    shape, places = given["shape"], given["broadcast_dimensions"]
    sizes = [1] * len(shape)
    for place, size in zip(places, rows.shape[1:], strict=True):
        sizes[place] = size
    return np.broadcast_to(rows.reshape(len(rows), *sizes), (len(rows), *shape))


def _products(given: Mapping, x: Form, y: Form) -> Form:
    """The general product of two arrays: batch, free and summed axes."""
    ((summed_x, summed_y), (batch_x, batch_y)) = given["dimension_numbers"]
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
    found = multiply(Form(left, x.starts), Form(rows, y.starts))
    last = len(found.shape)
    return total(found, tuple(range(last - len(summed_x), last)))


def _transposed(form: Form, order: Sequence[int]) -> Form:
    return Form(form.rows.transpose(0, *(axis + 1 for axis in order)), form.starts)


def _extreme(function: Callable) -> Rule:
    """Return the rule of the largest or smallest number along axes."""

    def rule(given: Mapping, x: Form) -> Form:
        axes = given["axes"]
        others = [axis for axis in range(len(x.shape)) if axis not in axes]
        x = _transposed(x, (*others, *axes))
        shape = tuple(x.shape[: len(others)])
        parts = np.moveaxis(x.rows.reshape(len(x.rows), *shape, -1), -1, 0)
        found = Form(parts[0], x.starts)
        for part in parts[1:]:
            found = function(found, Form(part, x.starts))
        return found

    return rule


def _clamped(low: Form, x: Form, high: Form) -> Form:
    return functions.smaller(functions.larger(x, low), high)


def _chosen(given: Mapping, truth: Form, *cases: Form) -> Form:
    if len(cases) != 2:
        raise ArgumentError("function", "must select between two cases", len(cases))
    return functions.choice(truth, *cases)


def _raised(given: Mapping, x: Form, y: Form) -> Form:
    if len(y.rows) > 2 or y.rest.any() or np.ptp(y.center):
        return functions.exponential(multiply(y, functions.logarithm(x)))
    return functions.power(x, float(y.center.flat[0]))


def _separated(given: Mapping, x: Form) -> list[Form]:
    return [Form(part, x.starts) for part in np.moveaxis(x.rows, given["axis"] + 1, 0)]


def _split(given: Mapping, x: Form) -> list[Form]:
    axis, ends = given["axis"] + 1, np.cumsum(given["sizes"])[:-1]
    return [Form(part, x.starts) for part in np.split(x.rows, ends, axis)]


def _places(index: Form) -> np.ndarray:
    """Return an index, which must be constant."""
    if index.reach.any():
        raise ArgumentError("function", "must index arrays by constants")
    return index.center.astype(int)


def _gathered(given: Mapping, x: Form, index: Form) -> Form:
    count = math.prod(x.shape)
    taken = jax.lax.gather(
        np.arange(count).reshape(x.shape),
        _places(index),
        given["dimension_numbers"],
        given["slice_sizes"],
        mode=given["mode"],
    )
    return Form(x.rows.reshape(len(x.rows), count)[:, np.asarray(taken)], x.starts)


def _scattered(given: Mapping, x: Form, index: Form, new: Form) -> Form | Sequence[Form]:
    """Some numbers replaced, by the places of all numbers in old and new ones together."""
    count, more = math.prod(x.shape), math.prod(new.shape)
    taken = jax.lax.scatter(
        np.arange(count).reshape(x.shape),
        _places(index),
        np.arange(count, count + more).reshape(new.shape),
        given["dimension_numbers"],
        mode=given["mode"],
    )

    def moved(_: Mapping, old: np.ndarray, rows: np.ndarray) -> np.ndarray:
        flat = np.concatenate([old.reshape(-1, count), rows.reshape(-1, more)], 1)
        return flat[:, np.asarray(taken)]

    return _moved(moved)(given, x, new)


def _sliced(given: Mapping, x: Form, *starts: Form) -> Form:
    sizes = given["slice_sizes"]
    first = [int(_places(one)) for one in starts]
    ends = [
        min(max(at, 0), length - size)
        for at, length, size in zip(first, x.shape, sizes, strict=True)
    ]
    cuts = (slice(at, at + size) for at, size in zip(ends, sizes, strict=True))
    return Form(x.rows[(slice(None), *cuts)], x.starts)


def _plain(function: Callable[..., Form]) -> Rule:
    """Return the rule of an operation without parameters."""
    return lambda given, *forms: function(*forms)


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
    "clamp": _clamped,
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
    "integer_pow": lambda given, x: functions.power(x, float(given["y"])),
    "pow": _raised,
    "select_n": _chosen,
    "dot_general": _products,
    "reduce_sum": lambda given, x: total(x, given["axes"]),
    "reduce_max": _extreme(functions.larger),
    "reduce_min": _extreme(functions.smaller),
    "gather": _gathered,
    "scatter": _scattered,
    "dynamic_slice": _sliced,
    "unstack": _separated,
    "split": _split,
    "slice": _moved(_cut),
    "broadcast_in_dim": _moved(_spread),
    "reshape": _moved(lambda given, rows: rows.reshape(len(rows), *given["new_sizes"])),
    "squeeze": _moved(
        lambda given, rows: rows.squeeze(tuple(axis + 1 for axis in given["dimensions"]))
    ),
    "transpose": _moved(
        lambda given, rows: rows.transpose(0, *(axis + 1 for axis in given["permutation"]))
    ),
    "rev": _moved(
        lambda given, rows: np.flip(rows, tuple(axis + 1 for axis in given["dimensions"]))
    ),
    "concatenate": _moved(lambda given, *rows: np.concatenate(rows, given["dimension"] + 1)),
    "stack": _moved(lambda given, *rows: np.stack(rows, given["axis"] + 1)),
}
"""Rules of operations by the names of JAX's primitives."""


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

_OF_TRUTHS = ("and", "or", "not")
_OF_REALS = ("div", "floor")


def _require_reals_and_truths(equation: Equation) -> None:
    """Refuse operations whose rules are of real numbers, or of truths, on other types."""
    kinds = [np.dtype(one.aval.dtype).kind for one in equation.inputs]
    rule, got = "", equation.name
    if equation.name == "convert_element_type":
        new = np.dtype(equation.parameters["new_dtype"])
        got = f"a conversion to {new}"
        if new.kind not in "biu" and new != np.float64:
            rule = "must compute with 64-bit numbers"
        elif new.kind in "biu" and kinds != [new.kind] and kinds != ["b"]:
            rule = "must compare numbers or take their floor, which has a rule"
    elif equation.name in _OF_TRUTHS and set(kinds) != {"b"}:
        rule, got = "must use bits of truths alone", f"`{got}` of whole numbers"
    elif equation.name in _OF_REALS and set(kinds) - {"f"}:
        rule, got = "must divide real numbers", f"`{got}` of whole numbers"
    if rule:
        place = summary_of(equation.place)
        raise ArgumentError("function", rule, got + (f" in {place}" if place else ""))


class _Step(NamedTuple):
    """An operation with the numbers of its operands and results."""

    name: str
    rule: Rule
    parameters: Mapping[str, Any]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


class FormProgram:
    """A function of arrays of the shapes of examples, evaluated for affine forms.

    Operations on constants are done once, and equal operations once a call. A `smooth` program has
    unbounded results where an operation may be at a corner or a jump. Raises `ArgumentError` for
    an operation without a rule.
    """

    def __init__(self, function: Callable, *examples: Any, smooth: bool = False):
        self._smooth = smooth
        with jax.enable_x64(True):
            program = jaxpr_of(function, *(np.asarray(one, float) for one in examples))
        self._constants: dict[int, Form] = {}
        self._known: dict[Any, tuple[int, ...]] = {}
        self._count = len(program.inputs)
        self._steps: list[_Step] = []
        self._outputs = self._inline(program, range(self._count))
        needed = set(self._outputs)
        kept = []
        for step in reversed(self._steps):
            if needed.intersection(step.outputs):
                needed.update(step.inputs)
                kept.append(step)
        self._steps = kept[::-1]

    def __call__(self, *forms: Form) -> list[Form]:
        """Return the forms of all results."""
        values = {**self._constants, **dict(enumerate(forms))}
        with np.errstate(all="ignore"):
            for step in self._steps:
                operands = [values[one] for one in step.inputs]
                found = step.rule(step.parameters, *operands)
                if isinstance(found, Form):
                    if self._smooth and step.name in CORNERS:
                        found = unbounded(CORNERS[step.name](*operands), found)
                    found = [found]
                values.update(zip(step.outputs, found, strict=True))
        return [values[one] for one in self._outputs]

    def _constant(self, value: Any) -> int:
        array = np.asarray(value)
        key = (array.shape, array.astype(float).tobytes())
        if key not in self._known:
            self._known[key] = (self._count,)
            self._constants[self._count] = exact(array)
            self._count += 1
        return self._known[key][0]

    def _inline(self, program: Jaxpr, inputs: Sequence[int]) -> list[int]:
        """Add a program's steps; return the numbers of its results."""
        places: dict[Any, int] = dict(zip(program.inputs, inputs, strict=True))
        places |= {variable: self._constant(value) for variable, value in program.constants}

        def place(atom: Any) -> int:
            return self._constant(atom.value) if isinstance(atom, Literal) else places[atom]

        for equation in program.equations:
            operands = tuple([place(atom) for atom in equation.inputs])
            if equation.is_call:
                results = self._inline(equation.parameters["body"], operands)
            else:
                results = self._added(equation, operands)
            places.update(zip(equation.outputs, results, strict=True))
        return [place(atom) for atom in program.outputs]

    def _added(self, equation: Equation, operands: tuple[int, ...]) -> tuple[int, ...]:
        """Add an operation unless it is known; return the numbers of its results."""
        key = (equation.name, operands, repr(equation.parameters))
        if key in self._known:
            return self._known[key]
        if equation.name == "iota":
            shape, axis = equation.parameters["shape"], equation.parameters["dimension"]
            return (self._constant(np.indices(shape)[axis]),)
        rule = RULES.get(equation.name)
        if rule is None or equation.unknown:
            place = summary_of(equation.place)
            got = f"`{equation.name}`" + (f" in {place}" if place else "")
            raise ArgumentError("function", "must contain only operations with a rule", got)
        _require_reals_and_truths(equation)
        results = tuple(range(self._count, self._count + len(equation.outputs)))
        self._count += len(results)
        step = _Step(equation.name, rule, equation.parameters, operands, results)
        if all(one in self._constants for one in operands):
            self._fold(equation, step)
        else:
            self._steps.append(step)
        self._known[key] = results
        return results

    def _fold(self, equation: Equation, step: _Step) -> None:
        """Do a step on constants; whole numbers remain exact."""
        with np.errstate(all="ignore"):
            found = step.rule(step.parameters, *(self._constants[one] for one in step.inputs))
        found = [found] if isinstance(found, Form) else found
        for output, number, form in zip(equation.outputs, step.outputs, found, strict=True):
            if output.aval.dtype.kind in "iub" and (form.reach < 0.1).all():
                form = exact(np.round(form.center))
            self._constants[number] = form
