"""Rules of reductions by any function, of moving windows, and of convolutions."""

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Scalar
from jaxsat.compiler.lowering import CannotLower, Elements, filled, lower, lowers
from jaxsat.compiler.rules.linear_algebra import inner_product
from jaxsat.compiler.rules.reductions import empty_value, from_zero, joining


def _by_program(b: Builder, eqn) -> Callable[[Sequence[Scalar], Sequence[Scalar]], list[Scalar]]:
    """Return the binary operation of the equation's own program."""

    def join(left: Sequence[Scalar], right: Sequence[Scalar]) -> list[Scalar]:
        arrays = [filled((), x) for x in (*left, *right)]
        return [array[()] for array in lower(b, eqn.parameters["body"], arrays)]

    return join


@lowers("reduce")
def _reduce(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    half = len(arrays) // 2
    xs, first = arrays[:half], [x[()] for x in arrays[half:]]
    axes = tuple(eqn.parameters["dimensions"])
    other_axes = [axis for axis in range(xs[0].ndim) if axis not in axes]
    shape = eqn.outputs[0].aval.shape
    length = int(np.prod([xs[0].shape[axis] for axis in axes]))
    several = [x.transpose([*other_axes, *axes]).reshape(*shape, length) for x in xs]
    outs = [np.empty(shape, object) for _ in xs]
    for index in np.ndindex(*shape):
        totals = reduce(_by_program(b, eqn), zip(*(x[index] for x in several), strict=True), first)
        for out, scalar in zip(outs, totals, strict=True):
            out[index] = scalar
    return outs


@lowers("reduce_window_sum", "reduce_window_max", "reduce_window_min")
def _named_window(b: Builder, eqn, x: Elements) -> Elements:
    name = eqn.name.removeprefix("reduce_window_")
    join = joining(b, name)
    start = empty_value(name, eqn.outputs[0].aval.dtype)
    windows = _windows(eqn, [x])
    shape = eqn.outputs[0].aval.shape
    out = np.empty(shape, object)
    for index in np.ndindex(*shape):
        scalars = [scalar for (scalar,) in windows(index)]
        first = [start] if name == "sum" else []
        out[index] = reduce(join, [*first, *scalars]) if scalars else start
    return out


@lowers("reduce_window")
def _window(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    half = len(arrays) // 2
    xs, first = list(arrays[:half]), [x[()] for x in arrays[half:]]
    windows, join = _windows(eqn, xs), _by_program(b, eqn)
    shape = eqn.outputs[0].aval.shape
    outs = [np.empty(shape, object) for _ in xs]
    for index in np.ndindex(*shape):
        for out, scalar in zip(outs, reduce(join, windows(index), first), strict=True):
            out[index] = scalar
    return outs


def _windows(eqn, xs: Sequence[Elements]) -> Callable[[tuple[int, ...]], list]:
    """Return the elements of a window by the place of its result, without padding."""
    params, size = eqn.parameters, eqn.parameters["window_dimensions"]
    steps = params["window_strides"], params["padding"]
    dilations = params["base_dilation"], params["window_dilation"]

    def inside(place: tuple[int, ...]) -> list[tuple[Scalar, ...]]:
        positions = [
            _position(xs[0].shape, place, index, *steps, *dilations) for index in np.ndindex(*size)
        ]
        return [tuple(x[at] for x in xs) for at in positions if at is not None]

    return inside


@lowers("conv_general_dilated")
def _convolution(b: Builder, eqn, x: Elements, weights: Elements) -> Elements:
    params, aval = eqn.parameters, eqn.outputs[0].aval
    if params["batch_group_count"] != 1:
        raise CannotLower("Convolutions with groups of a batch are not supported")
    numbers = params["dimension_numbers"]
    x, weights = x.transpose(numbers.lhs_spec), weights.transpose(numbers.rhs_spec)
    groups = params["feature_group_count"]
    inputs, outputs = x.shape[1] // groups, weights.shape[0] // groups
    steps = params["window_strides"], params["padding"]
    dilations = params["lhs_dilation"], params["rhs_dilation"]
    shape = tuple(aval.shape[axis] for axis in numbers.out_spec)
    out = np.empty(shape, object)
    for batch, feature, *place in np.ndindex(shape):
        first = feature // outputs * inputs
        pairs: tuple[list[Scalar], list[Scalar]] = ([], [])
        for index in np.ndindex(weights.shape[2:]):
            at = _position(x.shape[2:], place, index, *steps, *dilations)
            if at is not None:
                pairs[0].extend(x[(batch, slice(first, first + inputs), *at)])
                pairs[1].extend(weights[(feature, slice(None), *index)])
        total = inner_product(b, *pairs, aval.dtype)
        out[(batch, feature, *place)] = from_zero(b, total)
    return out.transpose(np.argsort(numbers.out_spec))


def _position(sizes, place, index, strides, padding, spreads, dilations) -> tuple[int, ...] | None:
    """Return the place of element `index` of the window at `place`, None in the padding."""
    at = []
    for axis, size in enumerate(sizes):
        number = place[axis] * strides[axis] - padding[axis][0] + index[axis] * dilations[axis]
        if number % spreads[axis] or not 0 <= number // spreads[axis] < size:
            return None
        at.append(number // spreads[axis])
    return tuple(at)
