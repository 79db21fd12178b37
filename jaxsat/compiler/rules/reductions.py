"""Rules of sums, extrema, searches and sorts of small arrays, unrolled."""

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import accumulate

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.lowering import LONG_SUM, Elements, filled, lowers
from jaxsat.compiler.operations import BOOL
from jaxsat.compiler.rules.elementwise import extremum

REDUCTIONS = ("sum", "prod", "max", "min", "and", "or", "xor")


def joining(b: Builder, name: str) -> Callable[[Scalar, Scalar], Scalar]:
    """Return the binary operation of a reduction of this name."""
    if name in ("max", "min"):
        return lambda x, y: extremum(b, name, x, y)
    operation = {"sum": "add", "prod": "mul"}.get(name, name)
    return lambda x, y: b.operation(operation, x, y)


def _begun(b: Builder, name: str, row: Sequence[Scalar]) -> Sequence[Scalar]:
    """Return the elements of a row for a reduction: a sum begins at 0.0, so no sum is -0.0."""
    if name != "sum" or not len(row):
        return row
    return [from_zero(b, row[0]), *row[1:]]


def from_zero(b: Builder, x: Scalar) -> Scalar:
    """Return 0 + x."""
    return b.operation("add", x, x.dtype.type(0))


def empty_value(name: str, dtype: np.dtype) -> Scalar:
    """Return the reduction of no elements."""
    if name in ("max", "min"):
        limits = np.finfo(dtype) if dtype.kind == "f" else np.iinfo(dtype)
        low, high = (-np.inf, np.inf) if dtype.kind == "f" else (limits.min, limits.max)
        return dtype.type(low if name == "max" else high)
    if name == "and":
        return np.True_ if dtype == BOOL else np.invert(dtype.type(0))
    return dtype.type(1 if name == "prod" else 0)


@lowers(*(f"reduce_{name}" for name in REDUCTIONS))
def _reduce(b: Builder, eqn, x: Elements) -> Elements:
    name = eqn.name.removeprefix("reduce_")
    axes = tuple(eqn.parameters["axes"])
    aval = eqn.outputs[0].aval
    if not x.size:
        return filled(aval.shape, empty_value(name, aval.dtype))
    other_axes = [axis for axis in range(x.ndim) if axis not in axes]
    rows = x.transpose([*other_axes, *axes]).reshape(int(np.prod(aval.shape)), -1)
    out = np.empty(len(rows), object)
    for i, row in enumerate(rows):
        if name == "sum" and _is_loop(b, row, LONG_SUM) and row[0].dtype.kind == "f":
            out[i] = _long_sum(b, row)
            continue
        out[i] = _joined(joining(b, name), name, _begun(b, name, list(row)))
    return out.reshape(aval.shape)


def _joined(join: Callable[[Scalar, Scalar], Scalar], name: str, row: Sequence[Scalar]) -> Scalar:
    """Reduce a row in order, or by a balanced tree where the order has no effect."""
    if name not in ("max", "min"):
        return reduce(join, row)
    while len(row) > 1:
        pairs = [join(x, y) for x, y in zip(row[::2], row[1::2], strict=False)]
        row = [*pairs, *row[2 * len(pairs) :]]
    return row[0]


def _long_sum(b: Builder, row: Elements) -> Scalar:
    """Return a sum as a loop: an inner product for a sum of products."""
    factors = [b.factors.get(x.number) if isinstance(x, Value) else None for x in row]
    out = (), row[0].dtype
    if None in factors:
        return b.loop("sum", list(row), [row.shape], out)[0]
    x, y = zip(*factors, strict=True)  # pyright: ignore
    return b.loop("product", [*x, *y], [row.shape, row.shape], out)[0]


def _is_loop(b: Builder, row: Elements, least: int) -> bool:
    """Whether a computed row is long enough for a loop in a compact program."""
    return b.compact and len(row) >= least and any(isinstance(x, Value) for x in row)


@lowers("cumsum", "cumprod", "cummax", "cummin")
def _accumulate(b: Builder, eqn, x: Elements) -> Elements:
    name = eqn.name.removeprefix("cum")
    axis, reverse = eqn.parameters["axis"], eqn.parameters["reverse"]
    rows = np.moveaxis(x, axis, -1)
    out = np.empty(rows.shape, object)
    for index in np.ndindex(rows.shape[:-1]):
        row = list(rows[index])[:: -1 if reverse else 1]
        running = list(accumulate(_begun(b, name, row), joining(b, name)))
        out[index] = running[:: -1 if reverse else 1]
    return np.moveaxis(out, -1, axis)


@lowers("argmax", "argmin")
def _arg_extremum(b: Builder, eqn, x: Elements) -> Elements:
    (axis,), dtype = eqn.parameters["axes"], np.dtype(eqn.parameters["index_dtype"])
    order = "gt" if eqn.name == "argmax" else "lt"
    rows = np.moveaxis(x, axis, -1)
    out = np.empty(rows.shape[:-1], object)
    for index in np.ndindex(rows.shape[:-1]):
        row = rows[index]
        if _is_loop(b, row, 3) and row[0].dtype.kind == "f":
            out[index] = b.loop(eqn.name, list(row), [row.shape], ((), dtype))[0]
            continue
        best, where = row[0], dtype.type(0)
        for number, value in enumerate(row[1:], 1):
            better = _better(b, order, value, best)
            best = b.select(better, value, best)
            where = b.select(better, dtype.type(number), where)
        out[index] = where
    return out


def _better(b: Builder, order: str, value: Scalar, best: Scalar) -> Scalar:
    """Whether `value` comes before `best`; NaN comes before all but an earlier NaN."""
    if value.dtype == BOOL:
        value, best = (b.convert(x, np.dtype(np.int32)) for x in (value, best))
    better = b.operation(order, value, best)
    if value.dtype.kind != "f":
        return better
    is_nan, was_number = b.operation("ne", value, value), b.operation("eq", best, best)
    return b.operation("or", better, b.operation("and", is_nan, was_number))


@lowers("sort")
def _sort(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    """Sort by exchanges of neighbours, which keeps the order of equal ones."""
    axis, keys = eqn.parameters["dimension"], eqn.parameters["num_keys"]
    rows = [np.moveaxis(x, axis, -1).copy() for x in arrays]
    for index in np.ndindex(rows[0].shape[:-1]):
        several = [list(row[index]) for row in rows]
        count = len(several[0])
        for last in range(count - 1, 0, -1):
            for i in range(last):
                wrong = _follows(b, [x[i] for x in several], [x[i + 1] for x in several], keys)
                for x in several:
                    low, high = x[i], x[i + 1]
                    x[i], x[i + 1] = b.select(wrong, high, low), b.select(wrong, low, high)
        for row, values in zip(rows, several, strict=True):
            row[index] = values
    return [np.moveaxis(row, -1, axis) for row in rows]


def _follows(b: Builder, one: list[Scalar], other: list[Scalar], keys: int) -> Scalar:
    """Whether `one` must come after `other`; NaN comes last."""
    follows: Scalar = np.False_
    for x, y in reversed(list(zip(one[:keys], other[:keys], strict=True))):
        if x.dtype == BOOL:
            x, y = (b.convert(z, np.dtype(np.int32)) for z in (x, y))
        after, equal = b.operation("gt", x, y), b.operation("eq", x, y)
        if x.dtype.kind == "f":
            x_nan, y_nan = b.operation("ne", x, x), b.operation("ne", y, y)
            after = b.operation("or", after, b.operation("and", x_nan, b.negation(y_nan)))
            equal = b.operation("or", equal, b.operation("and", x_nan, y_nan))
        follows = b.operation("or", after, b.operation("and", equal, follows))
    return follows
