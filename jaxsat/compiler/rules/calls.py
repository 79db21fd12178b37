"""Rules of primitives that only call a jaxpr, written out, called, or lowered once."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

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


def form_of(function: Function) -> tuple:
    """Return the form of a function that reads no values from outside but its arguments: equal for
    functions with the same steps, whose values and memories have other numbers."""
    numbers: dict[int, int] = {}

    def of(x: Any) -> Any:
        match x:
            case Value():
                return x.dtype.char, x.uniform, numbers.setdefault(x.number, len(numbers))
            case np.generic():
                return x.dtype.char, x.tobytes()
            case list() | tuple():
                return tuple(map(of, x))
            case ir.Block():
                return of(x.steps)
            case Function():
                return id(x)
            case ir.Memory():
                initial = None if x.initial is None else x.initial.tobytes()
                number = numbers.setdefault(x.number, len(numbers))
                return x.dtype.char, x.size, x.uniform, initial, of(x.elements), number
            case Mapping():
                return tuple(x.items())
            case _ if is_dataclass(x):
                return type(x).__name__, *(of(getattr(x, one.name)) for one in fields(x))
        return x

    parts = function.params, function.block, function.results
    return *map(of, parts), repr(function.source)
