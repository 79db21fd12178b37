"""Rules of products and solutions of small matrices, unrolled."""

from collections.abc import Iterable
from functools import reduce

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.lowering import LONG_SUM, Elements, arrays_of, lower, lowers, scalars_of
from jaxsat.compiler.operations import BOOL, INT
from jaxsat.compiler.rules.elementwise import absolute
from jaxsat.compiler.rules.reductions import from_zero


@lowers("dot_general")
def _dot_general(b: Builder, eqn, x: Elements, y: Elements) -> Elements:
    (x_sum, y_sum), (x_batch, y_batch) = eqn.parameters["dimension_numbers"]
    x_free = [axis for axis in range(x.ndim) if axis not in (*x_sum, *x_batch)]
    y_free = [axis for axis in range(y.ndim) if axis not in (*y_sum, *y_batch)]
    sizes = [
        int(np.prod([array.shape[axis] for axis in axes]))
        for array, axes in ((x, x_batch), (x, x_free), (x, x_sum), (y, y_free))
    ]
    batch, height, length, width = sizes
    if b.compact and not x_batch and len(x_sum) == 1 and _is_worth_a_call(x, y, length):
        aval = eqn.outputs[0].aval
        axes, out = (x_sum[0], y_sum[0]), (aval.shape, aval.dtype)
        results = b.loop("product", scalars_of([x, y]), [x.shape, y.shape], out, axes)
        return arrays_of(results, [aval.shape])[0]
    rows = x.transpose([*x_batch, *x_free, *x_sum]).reshape(batch, height, length)
    columns = y.transpose([*y_batch, *y_free, *y_sum]).reshape(batch, width, length)
    aval = eqn.outputs[0].aval
    products = np.empty((batch, height, width), object)
    for i, j, k in np.ndindex(products.shape):
        products[i, j, k] = inner_product(b, rows[i, j], columns[i, k], aval.dtype)
    return products.reshape(aval.shape)


def _is_worth_a_call(x: Elements, y: Elements, length: int) -> bool:
    """Whether a product in a compact program is a call of a function with loops."""
    if not x.size or not y.size:
        return False
    flat = x.ndim == y.ndim == 1
    plain = (
        max(x.ndim, y.ndim) == 2 and 1 not in (*x.shape, *y.shape) and x.flat[0].dtype.kind == "f"
    )
    is_known = not any(isinstance(z, Value) for array in (x, y) for z in array.flat)
    return not is_known and (length >= LONG_SUM if flat else plain and x.size * y.size >= 27)


def inner_product(b: Builder, x: Iterable[Scalar], y: Iterable[Scalar], dtype: np.dtype) -> Scalar:
    """Return the sum of products, in order and from 0.0; of bools: whether any pair holds."""
    times, plus = ("and", "or") if dtype == BOOL else ("mul", "add")
    terms = [
        b.operation(times, b.convert(p, dtype), b.convert(q, dtype))
        for p, q in zip(x, y, strict=True)
    ]
    if not terms:
        return dtype.type(0)
    if len(terms) > 1:
        terms[0] = from_zero(b, terms[0])
    return reduce(lambda p, q: b.operation(plus, p, q), terms)


@lowers("custom_linear_solve")
def _custom_linear_solve(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    """Lower the equation's function `solve`."""
    first = eqn.parameters["before"]
    last = first + eqn.parameters["n_solve"]
    sides = arrays[last + eqn.parameters["between"] :]
    return lower(b, eqn.parameters["solve"], [*arrays[first:last], *sides])


def _batches(x: Elements, *others: Elements):
    """Yield the index and matrix of a stack, and its part of the other arrays."""
    for index in np.ndindex(x.shape[:-2]):
        yield index, x[index], *(other[index] for other in others)


@lowers("lu")
def _lu(b: Builder, eqn, x: Elements) -> list[Elements]:
    del eqn
    size = min(x.shape[-2:])
    out = x.copy()
    pivots = np.empty((*x.shape[:-2], size), object)
    order = np.empty(x.shape[:-1], object)
    for index, matrix in _batches(out):
        _eliminate(b, matrix, pivots[index], order[index])
    return [out, pivots, order]


def _eliminate(b: Builder, x: Elements, pivots: Elements, order: Elements) -> None:
    """Factorise in place: both factors, the row exchanges, and the origins of all rows."""
    for row in range(len(x)):
        order[row] = INT.type(row)
    for k in range(len(pivots)):
        where = _pivot(b, x[:, k], k)
        pivots[k] = where
        for row in range(k + 1, len(x)):
            here = b.operation("eq", where, INT.type(row))
            _exchange(b, here, x, k, row)
            _exchange(b, here, order[:, None], k, row)
        nothing = b.operation("eq", x[k, k], x[k, k].dtype.type(0))
        for row in range(k + 1, len(x)):
            factor = b.operation("div", x[row, k], x[k, k])
            factor = x[row, k] = b.select(nothing, x[row, k], factor)
            for column in range(k + 1, x.shape[1]):
                product = b.operation("mul", factor, x[k, column])
                x[row, column] = b.operation("sub", x[row, column], product)


def _pivot(b: Builder, column: Elements, first: int) -> Scalar:
    best, where = absolute(b, column[first]), INT.type(first)
    for row in range(first + 1, len(column)):
        size = absolute(b, column[row])
        larger = b.operation("gt", size, best)
        best, where = b.select(larger, size, best), b.select(larger, INT.type(row), where)
    return where


def _exchange(b: Builder, if_so: Scalar, x: Elements, one: int, other: int) -> None:
    for column in range(x.shape[1]):
        p, q = x[one, column], x[other, column]
        x[one, column], x[other, column] = b.select(if_so, q, p), b.select(if_so, p, q)


@lowers("cholesky")
def _cholesky(b: Builder, eqn, x: Elements) -> Elements:
    """Return the lower factor; NaN where the matrix is not positive definite."""
    out = np.empty(x.shape, object)
    dtype = eqn.outputs[0].aval.dtype
    for _, matrix, factor in _batches(x, out):
        good: Scalar = np.True_
        for j in range(len(matrix)):
            factor[j, j + 1 :] = [dtype.type(0)] * (len(matrix) - j - 1)
            square = _reduced(b, matrix[j, j], factor[j, :j], factor[j, :j])
            good = b.operation("and", good, b.operation("gt", square, dtype.type(0)))
            factor[j, j] = b.operation("sqrt", square)
            for i in range(j + 1, len(matrix)):
                rest = _reduced(b, matrix[i, j], factor[i, :j], factor[j, :j])
                factor[i, j] = b.operation("div", rest, factor[j, j])
        for i, j in zip(*np.tril_indices(len(matrix)), strict=True):
            factor[i, j] = b.select(good, factor[i, j], dtype.type(np.nan))
    return out


def _reduced(b: Builder, x: Scalar, row: Iterable[Scalar], column: Iterable[Scalar]) -> Scalar:
    """Return x less the inner product."""
    for p, q in zip(row, column, strict=True):
        x = b.operation("sub", x, b.operation("mul", p, q))
    return x


@lowers("triangular_solve")
def _triangular_solve(b: Builder, eqn, a: Elements, y: Elements) -> Elements:
    params = eqn.parameters
    lower_half = params["lower"]
    if params["transpose_a"]:
        a, lower_half = np.swapaxes(a, -1, -2), not lower_half
    if not params["left_side"]:  # x a = y is a' x' = y'
        a, y, lower_half = np.swapaxes(a, -1, -2), np.swapaxes(y, -1, -2), not lower_half
    out = np.empty(y.shape, object)
    for _, matrix, sides, solution in _batches(a, y, out):
        order = range(len(matrix)) if lower_half else range(len(matrix))[::-1]
        for i in order:
            solved = slice(0, i) if lower_half else slice(i + 1, len(matrix))
            for column in range(sides.shape[1]):
                rest = _reduced(b, sides[i, column], matrix[i, solved], solution[solved, column])
                if not params["unit_diagonal"]:
                    rest = b.operation("div", rest, matrix[i, i])
                solution[i, column] = rest
    return out if params["left_side"] else np.swapaxes(out, -1, -2)
