"""Rules of primitives that only call a jaxpr, and of those composed of others in `jax.numpy`."""

import functools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Shaped

from jaxsat.compiler import ir
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, Scalar, Source, Value, numbers_of, uses
from jaxsat.compiler.lowering import (
    LONGEST,
    Elements,
    arrays_of,
    lower,
    lowers,
    scalars_of,
    written,
)
from jaxsat.compiler.passes.dead_code import without_dead_code
from jaxsat.core.jax_internals import CALL


@lowers(CALL)
def _call(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    inner = eqn.parameters["body"]
    if id(inner) in b.outlined:
        return _outlined_call(b, inner, arrays)
    if id(inner) in b.repeated and not _has_large_from_outside(b, arrays):
        return _shared_call(b, eqn, inner, arrays)
    return lower(b, inner, arrays)


def _has_large_from_outside(b: Builder, arrays: Sequence[Elements]) -> bool:
    """Whether one of the arrays is better read in place than passed."""
    large = (array.flat[0] for array in arrays if array.size > LONGEST)
    return any(isinstance(first, Value) and first.number in b.outside for first in large)


def _shared_call(b: Builder, eqn, inner, arrays: Sequence[Elements]) -> list[Elements]:
    """Call a function that is shared by several calls, with constant arguments folded in."""
    args = scalars_of(arrays)
    signature = tuple(
        (x.dtype.char, x.uniform) if isinstance(x, Value) else (x.dtype.char, x.tobytes())
        for x in args
    )
    arguments = [x for x in args if isinstance(x, Value)]
    key = (id(inner), signature)
    if key not in b.functions:
        params = [Value(x.dtype, x.uniform) for x in arguments]
        rest = iter(params)
        inside = [next(rest) if isinstance(x, Value) else x for x in args]
        body = Builder(like=b)
        shapes = [array.shape for array in arrays]
        results = scalars_of(lower(body, inner, arrays_of(inside, shapes)))
        label = f"{eqn.parameters['name']}.{len(b.functions)}"
        b.functions[key] = without_dead_code(Function(label, params, body.block, results))
    outs = b.call(b.functions[key], arguments)
    return arrays_of(outs, [var.aval.shape for var in eqn.outputs])


def _outlined_call(b: Builder, inner, arrays: Sequence[Elements]) -> list[Elements]:
    """Call a Python function, which is lowered once for all equal uses.

    Integers with other ranges are another use, unless the function's steps are the same. Constants
    are passed like values, except integers, which mostly are indices, and those of a function that
    is called once. Unused arrays are not passed, and results that are constants or arguments are
    not returned.
    """
    once = b.outlined[id(inner)][3] == 1
    folded = [
        all(not isinstance(x, Value) and (once or x.dtype.kind != "f") for x in array.flat)
        for array in arrays
    ]
    constants = [
        tuple((x.dtype.char, x.tobytes()) for x in array.flat) if fold else None
        for array, fold in zip(arrays, folded, strict=True)
    ]
    kinds = [array.flat[0].dtype.char if array.size else "" for array in arrays]
    ranges = [
        None if fold else _ranges_in(b, array) for array, fold in zip(arrays, folded, strict=True)
    ]
    key = (id(inner), *constants, *kinds, *ranges)
    if key not in b.variants:
        b.variants[key] = _python_function(b, inner, arrays, folded)
    function, needs, plan, bounds = b.variants[key]
    if function.source is not None and function.source.results:
        args = scalars_of([array for array, want in zip(arrays, needs, strict=True) if want])
        parts = iter(arrays_of(b.call(function, args, bounds), function.source.results))
    else:
        parts = iter(())
    every = scalars_of(arrays)
    return [next(parts) if one is None else _array_of(one, every) for one in plan]


def _ranges_in(b: Builder, array: Elements) -> tuple[tuple[int, int] | None, ...]:
    """Return the known ranges of an array's integers."""
    if not array.size or array.flat[0].dtype.kind not in "iu":
        return ()
    return tuple(map(b.ranges.of, array.flat))


def _array_of(plan: Elements, scalars: Sequence[Scalar]) -> Elements:
    """Return an array of a function's arguments (by number of scalars) and of constants."""
    out = np.empty(plan.shape, object)
    for index in np.ndindex(plan.shape):
        one = plan[index]
        out[index] = scalars[one] if isinstance(one, int) else one
    return out


def _python_function(b: Builder, inner, arrays: Sequence[Elements], folded: Sequence[bool]):
    """Lower a Python function; return it or an earlier one with the same steps, its needed arrays,
    the origin of unmade results, and the ranges of the others."""
    _, name, file, _ = b.outlined[id(inner)]
    inside = []
    for array, fold in zip(arrays, folded, strict=True):
        own = np.empty(array.shape, object)
        for index in np.ndindex(array.shape):
            own[index] = array[index] if fold else _argument(b, array[index])
        inside.append(own)
    body = Builder(like=b)
    body.parameters = set(numbers_of(scalars_of(inside)))
    with b.at(()):
        results = lower(body, inner, inside)
    places = {x.number: i for i, x in enumerate(scalars_of(inside)) if isinstance(x, Value)}
    plan = [_plan(result, places) for result in results]
    own_results = [result for result, one in zip(results, plan, strict=True) if one is None]
    label = f"{name}.{len(b.variants)}"
    function = without_dead_code(Function(label, [], body.block, scalars_of(own_results)))
    reads = {number for step in function.block.steps for number in uses(step)}
    reads |= {x.number for x in function.results if isinstance(x, Value)}
    needs = [
        not fold and any(x.number in reads for x in array.flat)
        for array, fold in zip(inside, folded, strict=True)
    ]
    inputs = [array for array, want in zip(inside, needs, strict=True) if want]
    function.params = scalars_of(inputs)  # pyright: ignore[reportAttributeAccessIssue]
    shapes = [array.shape for array in inputs], [array.shape for array in own_results]
    function.source = Source(name, file, *shapes)
    bounds = [b.ranges.of(x) for x in function.results]
    function = b.variants.setdefault((id(inner), form_of(function)), function)
    return function, needs, plan, bounds


def _argument(b: Builder, x: Scalar) -> Value:
    """Return the argument of a function that stands for a number, of the same range."""
    argument, bounds = Value(x.dtype, True), b.ranges.of(x)
    if bounds is not None:
        b.ranges.note(argument, *bounds)
    return argument


def _plan(result: Elements, places: dict[int, int]) -> Elements | None:
    """Return argument numbers and constants, or None where an element is computed."""
    out = np.empty(result.shape, object)
    for index in np.ndindex(result.shape):
        x = result[index]
        if isinstance(x, Value) and x.number not in places:
            return None
        out[index] = places[x.number] if isinstance(x, Value) else x
    return out


def _top_k(x: Array, k: int, axis: int) -> list[Array]:
    """Return the largest first, equal ones in their order; floats in IEEE 754's total order, as
    XLA's: -0.0 below 0.0, NaN beyond all on the side of its sign."""
    numbers = lax.broadcasted_iota(jnp.int32, x.shape, axis)
    last = [lax.rev(y, (axis,)) for y in (_in_total_order(x), x, numbers)]
    ordered = lax.sort(last, dimension=axis, num_keys=1)[1:]
    return [lax.slice_in_dim(lax.rev(y, (axis,)), 0, k, axis=axis) for y in ordered]


def _in_total_order(x: Array) -> Array:
    """Return integers in the order of these: the bits of a float, flipped for a negative one."""
    if x.dtype.kind != "f":
        return x
    word = np.dtype(f"i{x.dtype.itemsize}")
    bits = lax.bitcast_convert_type(x, word)
    return jnp.where(bits < 0, bits ^ np.iinfo(word).max, bits)


def _nextafter(x: Array, y: Array) -> Array:
    whole = jnp.int64 if x.dtype == jnp.float64 else jnp.int32
    bits = lax.bitcast_convert_type(x, whole)
    outwards = jnp.where((y > x) == (x > 0), bits + 1, bits - 1)
    least = lax.bitcast_convert_type(jnp.ones_like(bits), x.dtype)
    neighbour = jnp.where(
        x == 0, jnp.copysign(least, y), lax.bitcast_convert_type(outwards, x.dtype)
    )
    return jnp.where(x == y, y, jnp.where((x != x) | (y != y), np.nan, neighbour))


def _clz(x: Array) -> Array:
    """Count leading zeros: all bits below the first one are set and counted."""
    width = 8 * x.dtype.itemsize
    shift = 1
    while shift < width:
        x = x | lax.shift_right_logical(x, jnp.full_like(x, shift))
        shift *= 2
    return jnp.full_like(x, width) - lax.population_count(x)


def _tile(x: Shaped[Array, "..."], reps: tuple[int, ...]) -> Array:
    for axis, times in enumerate(reps):
        x = lax.concatenate([x] * times, axis)
    return x


def _reduce_precision(x: Array, exponent_bits: int, mantissa_bits: int) -> Array:
    """Return the nearest float of fewer bits, ties to even; subnormal results become zero."""
    info = jnp.finfo(x.dtype)
    word = np.dtype(f"u{x.dtype.itemsize}")
    bits, surplus = lax.bitcast_convert_type(x, word), info.nmant - mantissa_bits
    if surplus > 0:
        odd = (bits >> word.type(surplus)) & word.type(1)
        bits = bits + odd + word.type(2 ** (surplus - 1) - 1)
        bits = bits & np.invert(word.type(2**surplus - 1))
    if exponent_bits < info.nexp:
        bias, reduced = 2 ** (info.nexp - 1) - 1, 2 ** (exponent_bits - 1) - 1
        top, bottom = (word.type((bias + end) << info.nmant) for end in (reduced, -reduced))
        infinite = word.type((2**info.nexp - 1) << info.nmant)
        sign, exponent = bits & word.type(1 << (info.bits - 1)), bits & infinite
        bits = jnp.where(exponent > top, sign | infinite, bits)
        bits = jnp.where(exponent <= bottom, sign, bits)
    return jnp.where(x != x, x, lax.bitcast_convert_type(bits, x.dtype))


def _polynomial(x: Array, *coefficients: Array) -> Array:
    return functools.reduce(lambda total, c: total * x + c, reversed(coefficients))


COMPOSED: dict[str, Callable[..., Callable]] = {
    "clz": lambda **_: _clz,
    "cumlogsumexp": lambda **axis: partial(lax.associative_scan, jnp.logaddexp, **axis),
    "log2": lambda **_: lambda x: lax.log(x) / np.log(2).astype(x.dtype),
    "nextafter": lambda **_: _nextafter,
    "one_minus_square": lambda **_: lambda x: (1 + x) * (1 - x),
    "polynomial": lambda **_: _polynomial,
    "reduce_precision": lambda **bits: partial(_reduce_precision, **bits),
    "rsqrt": lambda **_: lambda x: 1 / jnp.sqrt(x),
    "square": lambda **_: lambda x: x * x,
    "tile": lambda reps, **_: partial(_tile, reps=reps),
    "top_k": lambda k, axis=-1, **_: partial(_top_k, k=k, axis=axis),
}
"""Makers of a primitive's function from its parameters, by the primitive's name."""


@lowers(*COMPOSED)
def _composed(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    shapes = [
        jax.ShapeDtypeStruct(x.shape, v.aval.dtype) for x, v in zip(arrays, eqn.inputs, strict=True)
    ]
    function = COMPOSED[eqn.name](**eqn.parameters)
    return written(b, function, shapes, *arrays)


def form_of(function: ir.Function) -> tuple:
    """Return the form of a function that reads no values from outside but its arguments."""
    return _Form().of(function)


class _Form:
    """Numbers of values and memories in the order in which a function names them."""

    def __init__(self):
        self._numbers: dict[int, int] = {}

    def of(self, function: ir.Function) -> tuple:
        params = self._scalars(function.params)
        block = self._block(function.block)
        return params, block, self._scalars(function.results), repr(function.source)

    def _block(self, block: ir.Block) -> tuple:
        return tuple(map(self._step, block.steps))

    def _step(self, step: ir.Step) -> tuple:
        match step:
            case ir.Operation(name=name, args=args, out=out):
                return (name, self._scalars(args), self._scalar(out))
            case ir.Load(memory=memory, index=index, out=out):
                return ("load", self._memory(memory), self._scalars([index, out]))
            case ir.Store(memory=memory, index=index, value=value):
                return ("store", self._memory(memory), self._scalars([index, value]))
            case ir.Call(function=function, args=args, outs=outs):
                return ("call", id(function), self._scalars(args), self._scalars(outs))
            case ir.BlockSwitch(index=index, blocks=blocks, yields=yields, outs=outs):
                parts = [
                    (self._block(block), self._scalars(results))
                    for block, results in zip(blocks, yields, strict=True)
                ]
                names = tuple(step.names.items())
                head = self._scalar(index), step.cold, names
                return ("switch", head, tuple(parts), self._scalars(outs))
            case ir.Loop(params=params, before=before, condition=test, body=body):
                head = self._scalars(before), self._scalars(params)
                tested = self._block(test), self._scalar(step.active)
                return ("loop", head, tested, self._block(body), self._scalars(step.after))

    def _scalars(self, scalars: Sequence[ir.Scalar]) -> tuple:
        return tuple(map(self._scalar, scalars))

    def _scalar(self, x: ir.Scalar) -> Any:
        if isinstance(x, ir.Value):
            return (x.dtype.char, x.uniform, self._number(x.number))
        return (x.dtype.char, x.tobytes())

    def _memory(self, memory: ir.Memory) -> tuple:
        initial = None if memory.initial is None else memory.initial.tobytes()
        kind = memory.dtype.char, memory.size, memory.uniform, initial
        return (*kind, self._scalars(memory.elements), self._number(memory.number))

    def _number(self, number: int) -> int:
        return self._numbers.setdefault(number, len(self._numbers))
