"""Primitives that only call a jaxpr of their own: what they call is lowered in their place."""

from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, Scalar, Source, Value, uses
from jaxsat.compiler.lowering import Elements, arrays_of, lower, lowers, scalars_of
from jaxsat.compiler.passes.dead_code import without_dead_code
from jaxsat.core.jax_internals import CALL


@lowers(CALL)
def _call(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    inner = eqn.parameters["body"]
    if id(inner) in b.outlined:
        return _outlined(b, inner, arrays)
    if id(inner) in b.repeated:
        return _shared(b, eqn, inner, arrays)
    return lower(b, inner, arrays)


def _shared(b: Builder, eqn, inner, arrays: Sequence[Elements]) -> list[Elements]:
    """A call of one function for all that is called several times, known arguments folded in."""
    args = scalars_of(arrays)
    known = tuple(
        (x.dtype.char, x.uniform) if isinstance(x, Value) else (x.dtype.char, x.tobytes())
        for x in args
    )
    given = [x for x in args if isinstance(x, Value)]
    key = (id(inner), known)
    if key not in b.functions:
        params = [Value(x.dtype, x.uniform) for x in given]
        rest = iter(params)
        inside = [next(rest) if isinstance(x, Value) else x for x in args]
        body = Builder(like=b)
        body.functions, body.repeated = b.functions, b.repeated
        shapes = [array.shape for array in arrays]
        results = scalars_of(lower(body, inner, arrays_of(inside, shapes)))
        label = f"{eqn.parameters['name']}.{len(b.functions)}"
        b.functions[key] = without_dead_code(Function(label, params, body.block, results))
    found = b.call(b.functions[key], given)
    return arrays_of(found, [var.aval.shape for var in eqn.outputs])


def _outlined(b: Builder, inner, arrays: Sequence[Elements]) -> list[Elements]:
    """A call of a Python function, which is made once for all that may be the same.

    Known numbers are handed over like others, but for whole numbers, which mostly are indices, and
    those of a function that is called once.
    Arrays that it does not need are not handed over, and results that are known or given to it
    are not handed back.
    """
    once = b.outlined[id(inner)][3] == 1
    folded = [
        all(not isinstance(x, Value) and (once or x.dtype.kind != "f") for x in array.flat)
        for array in arrays
    ]
    known = [
        tuple((x.dtype.char, x.tobytes()) for x in array.flat) if fold else None
        for array, fold in zip(arrays, folded, strict=True)
    ]
    kinds = [array.flat[0].dtype.char if array.size else "" for array in arrays]
    key = (id(inner), *known, *kinds)
    if key not in b.made:
        b.made[key] = _made(b, inner, arrays, folded)
    function, wanted, plan = b.made[key]
    if function.source is not None and function.source.results:
        given = scalars_of([array for array, want in zip(arrays, wanted, strict=True) if want])
        parts = iter(arrays_of(b.call(function, given), function.source.results))
    else:
        parts = iter(())
    every = scalars_of(arrays)
    return [next(parts) if one is None else _handed_on(one, every) for one in plan]


def _handed_on(plan: Elements, given: Sequence[Scalar]) -> Elements:
    """An array of what a function was given (numbers of scalars) and of constants."""
    out = np.empty(plan.shape, object)
    for index in np.ndindex(plan.shape):
        one = plan[index]
        out[index] = given[one] if isinstance(one, int) else one
    return out


def _made(b: Builder, inner, arrays: Sequence[Elements], folded: Sequence[bool]):
    """The function, which arrays it needs, and where results come from that it does not make."""
    _, name, file, _ = b.outlined[id(inner)]
    inside = []
    for array, fold in zip(arrays, folded, strict=True):
        own = np.empty(array.shape, object)
        for index in np.ndindex(array.shape):
            own[index] = array[index] if fold else Value(array[index].dtype, True)
        inside.append(own)
    body = Builder(like=b)
    body.functions, body.repeated = b.functions, b.repeated
    with b.at(()):
        results = lower(body, inner, inside)
    places = {x.number: i for i, x in enumerate(scalars_of(inside)) if isinstance(x, Value)}
    plan = [_plan(result, places) for result in results]
    made = [result for result, one in zip(results, plan, strict=True) if one is None]
    label = f"{name}.{len(b.made)}"
    function = without_dead_code(Function(label, [], body.block, scalars_of(made)))
    read = {number for step in function.block.steps for number in uses(step)}
    read |= {x.number for x in function.results if isinstance(x, Value)}
    wanted = [
        not fold and any(x.number in read for x in array.flat)
        for array, fold in zip(inside, folded, strict=True)
    ]
    needed = [array for array, want in zip(inside, wanted, strict=True) if want]
    function.params = scalars_of(needed)  # pyright: ignore[reportAttributeAccessIssue]
    shapes = [array.shape for array in needed], [array.shape for array in made]
    function.source = Source(name, file, *shapes)
    return function, wanted, plan


def _plan(result: Elements, places: dict[int, int]) -> Elements | None:
    """Numbers of given scalars and constants, or None where anything is made."""
    out = np.empty(result.shape, object)
    for index in np.ndindex(result.shape):
        x = result[index]
        if isinstance(x, Value) and x.number not in places:
            return None
        out[index] = places[x.number] if isinstance(x, Value) else x
    return out
