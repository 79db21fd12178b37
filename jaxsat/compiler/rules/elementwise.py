"""Rules of arithmetic, comparisons, selections and conversions, element by element."""

from collections.abc import Callable
from typing import Any

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.lowering import CannotLower, Elements, each, lowers
from jaxsat.compiler.operations import BOOL
from jaxsat.core.jax_internals import IDENTICAL

SAME = {"add_any": "add"} | {
    name: name
    for name in (
        *("add", "sub", "mul", "sqrt", "floor", "ceil", "lt", "le", "gt", "ge"),
        *("and", "or", "xor", "population_count"),
    )
}
"""Primitives that are an operation of the table."""


@lowers(*SAME)
def _same(b: Builder, eqn, *arrays: Elements) -> Elements:
    name = SAME[eqn.name]
    return each(lambda *scalars: b.operation(name, *scalars), *arrays)


@lowers(*IDENTICAL)
def _identical(b: Builder, eqn, *arrays: Elements):
    del b, eqn
    return list(arrays)


@lowers("eq", "ne")
def _equal(b: Builder, eqn, x: Elements, y: Elements) -> Elements:
    def compare(x, y):
        if x.dtype == BOOL:
            differ = b.operation("xor", x, y)
            return differ if eqn.name == "ne" else b.negation(differ)
        return b.operation(eqn.name, x, y)

    return each(compare, x, y)


@lowers("shift_left", "shift_right_logical", "shift_right_arithmetic")
def _shift(b: Builder, eqn, x: Elements, y: Elements) -> Elements:
    name = eqn.name

    def shift(x, y):
        width = x.dtype.itemsize * 8
        if not isinstance(y, Value) and 0 <= int(y) < width:
            return b.operation(name, x, y)
        unsigned = np.dtype(f"u{x.dtype.itemsize}")
        count = b.operation("bitcast", y, dtype=unsigned)
        inside = b.operation("lt", count, unsigned.type(width))
        shifted = b.operation(name, x, b.select(inside, y, y.dtype.type(width - 1)))
        if name == "shift_right_arithmetic":
            return shifted
        return b.select(inside, shifted, x.dtype.type(0))

    return each(shift, x, y)


def negative(b: Builder, x: Scalar) -> Scalar:
    """Return -x."""
    if x.dtype.kind == "f":
        return b.operation("neg", x)
    return b.operation("sub", x.dtype.type(0), x)


def absolute(b: Builder, x: Scalar) -> Scalar:
    """Return |x|."""
    if x.dtype.kind == "f":
        return b.operation("abs", x)
    if x.dtype.kind == "u":
        return x
    return b.select(b.operation("lt", x, x.dtype.type(0)), negative(b, x), x)


def _sign(b: Builder, x: Scalar) -> Scalar:
    zero, one = x.dtype.type(0), x.dtype.type(1)
    above = b.operation("gt", x, zero)
    if x.dtype.kind == "u":
        return b.select(above, one, zero)
    below = b.operation("lt", x, zero)
    rest = x if x.dtype.kind == "f" else zero  # NaN and both zeros stay
    return b.select(above, one, b.select(below, x.dtype.type(-1), rest))


def quotient(b: Builder, x: Scalar, y: Scalar) -> Scalar:
    """Return x / y; integers as in XLA: -1 where y is zero."""
    if x.dtype.kind == "f":
        if not isinstance(y, Value) and _is_power_of_two(y):
            return b.operation("mul", x, y.dtype.type(1 / float(y)))  # the same in all bits
        return b.operation("div", x, y)
    by_zero = -1 if x.dtype.kind == "i" else 2 ** (8 * x.dtype.itemsize) - 1
    return _whole(b, "div", x, y, x.dtype.type(by_zero))


def _is_power_of_two(x: Any) -> bool:
    """Whether a number and its reciprocal are both powers of two and normal."""
    return bool(1e-30 < abs(x) < 1e30 and abs(np.frexp(x)[0]) == 0.5)


def _remainder(b: Builder, x: Scalar, y: Scalar) -> Scalar:
    return b.operation("rem", x, y) if x.dtype.kind == "f" else _whole(b, "rem", x, y, x)


def _whole(b: Builder, name: str, x: Scalar, y: Scalar, by_zero: Scalar) -> Scalar:
    """Divide integers by a divisor that cannot trap."""
    zero, one = x.dtype.type(0), x.dtype.type(1)
    none = b.operation("eq", y, zero)
    if b.compact and isinstance(y, Value) and x.dtype.kind == "i":
        return b.select(none, by_zero, b.operation(name, x, y))
    safe = b.select(none, one, y)
    if x.dtype.kind == "u":
        return b.select(none, by_zero, b.operation(name, x, safe))
    minus = b.operation("eq", y, x.dtype.type(-1))
    safe = b.select(minus, one, safe)
    at_minus = negative(b, x) if name == "div" else zero
    return b.select(none, by_zero, b.select(minus, at_minus, b.operation(name, x, safe)))


def extremum(b: Builder, name: str, x: Scalar, y: Scalar) -> Scalar:
    """Return the larger ("max") or smaller one; NaN where either is NaN, and -0.0 below 0.0."""
    if x.dtype == BOOL:
        return b.operation("or" if name == "max" else "and", x, y)
    return b.operation(name, x, y)


def _select(b: Builder, which: Scalar, *cases: Scalar) -> Scalar:
    if which.dtype == BOOL:
        return b.select(which, cases[1], cases[0]) if len(cases) == 2 else cases[0]
    result = cases[-1]
    for number in reversed(range(len(cases) - 1)):
        here = b.operation("le", which, which.dtype.type(number))
        result = b.select(here, cases[number], result)
    return result


def _not(b: Builder, x: Scalar) -> Scalar:
    full = np.True_ if x.dtype == BOOL else np.invert(x.dtype.type(0))
    return b.operation("xor", x, full)


OF_SCALARS: dict[str, Callable[..., Scalar]] = {
    "abs": absolute,
    "clamp": lambda b, low, x, high: extremum(b, "min", extremum(b, "max", x, low), high),
    "div": quotient,
    "is_finite": lambda b, x: b.operation("lt", b.operation("abs", x), x.dtype.type(np.inf)),
    "max": lambda b, x, y: extremum(b, "max", x, y),
    "min": lambda b, x, y: extremum(b, "min", x, y),
    "neg": negative,
    "not": _not,
    "rem": _remainder,
    "select_n": _select,
    "sign": _sign,
}
"""Functions of the scalars of one place, by the primitive's name."""


@lowers(*OF_SCALARS)
def _of_scalars(b: Builder, eqn, *arrays: Elements) -> Elements:
    function = OF_SCALARS[eqn.name]
    return each(lambda *scalars: function(b, *scalars), *arrays)


@lowers("convert_element_type")
def _convert(b: Builder, eqn, x: Elements) -> Elements:
    dtype = np.dtype(eqn.parameters["new_dtype"])
    if dtype.kind not in "fiub":
        raise CannotLower(f"Arrays of type {dtype} are not supported")

    def convert(x):
        if dtype == BOOL and x.dtype != BOOL:
            return b.operation("ne", x, x.dtype.type(0))
        return b.convert(x, dtype)

    return each(convert, x)


@lowers("bitcast_convert_type")
def _bitcast(b: Builder, eqn, x: Elements) -> Elements:
    dtype = np.dtype(eqn.parameters["new_dtype"])
    if x.size and dtype.itemsize != x.flat[0].dtype.itemsize:
        raise CannotLower("Bits can be read as another type of the same width only")
    return each(lambda x: b.operation("bitcast", x, dtype=dtype), x)


@lowers("round")
def _round(b: Builder, eqn, x: Elements) -> Elements:
    if int(eqn.parameters["rounding_method"]) == 1:
        return each(lambda x: b.operation("round_even", x), x)

    def away(x):
        size = b.operation("abs", x)
        below = b.operation("floor", size)
        half = b.operation("ge", b.operation("sub", size, below), x.dtype.type(0.5))
        whole = b.operation("add", below, b.select(half, x.dtype.type(1), x.dtype.type(0)))
        return b.operation("copysign", whole, x)

    return each(away, x)


@lowers("eq_to", "le_to", "lt_to")
def _in_total_order(b: Builder, eqn, x: Elements, y: Elements) -> Elements:
    """Compare by bits: -0.0 before 0.0, NaN after infinity (before it with a sign)."""
    name = eqn.name.removesuffix("_to")
    return each(
        lambda x, y: b.operation(name, _ordered_like_bits(b, x), _ordered_like_bits(b, y)), x, y
    )


def _ordered_like_bits(b: Builder, x: Scalar) -> Scalar:
    """Return an integer that is ordered like the bits of a float."""
    if x.dtype.kind != "f":
        return b.convert(x, np.dtype(np.uint8)) if x.dtype == BOOL else x
    whole = np.dtype(f"i{x.dtype.itemsize}")
    bits = b.operation("bitcast", x, dtype=whole)
    below = b.operation("lt", bits, whole.type(0))
    return b.select(below, b.operation("xor", bits, whole.type(np.iinfo(whole).max)), bits)
