"""Fields of structures that functions of a stage access directly, not by arguments.

A parameter that is the same field of parameters, input or state in all calls is read there, and a
result that its only caller keeps in the next state or the output is written there.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from jaxsat.compiler.c.naming import name_of
from jaxsat.compiler.ir import Call, Function, Scalar, Value
from jaxsat.compiler.trace import Trace

READ = ("p->", "at->", "in->", "now->", "seen->", "attitude[")
"""Prefixes of fields that functions read directly."""


@dataclass
class Context:
    """C expressions of a function's parameters and results that are fields, by the values' numbers.

    `assignments` are results to be written to fields at the end, `results` says which arrays of
    results are fields, and `wishes` are names for the array parameters, one each.
    """

    function: Function
    expressions: dict[int, str] = field(default_factory=dict)
    places: dict[int, str] = field(default_factory=dict)
    assignments: list[tuple[str, Scalar]] = field(default_factory=list)
    results: Sequence[bool] = ()
    wishes: Sequence[str] = ()


def contexts(begin: Context, trace: Trace) -> dict[int, Context]:
    """Return the contexts of all functions made of Python functions, callers first, by identity.

    `begin` is the context of the first one.
    """
    root = begin.function
    by_identity = {id(root): begin}
    sites: dict[int, list[tuple[Function, Call]]] = {}
    functions = _callers_first(root, sites)
    for function in functions[::-1]:
        for call in function.block.calls():
            _name_results(call, trace)
    for function in functions:
        if function is not root:
            by_identity[id(function)] = _context(function, sites[id(function)], by_identity, trace)
    return by_identity


def _name_results(call: Call, trace: Trace) -> None:
    """Name the results of a call with several results as the function does."""
    source = call.function.source
    if source is None or source.loop or len(source.results) < 2:
        return
    results = arrays_in(call.function.results, source.results)
    for array, outs in zip(results, arrays_in(call.outs, source.results), strict=True):
        name = name_of(trace, array[0], "result")
        trace.names.update((out.number, name) for out in outs)  # pyright: ignore


_T = TypeVar("_T")


def arrays_in(scalars: Sequence[_T], shapes: Sequence[tuple[int, ...]]) -> list[list[_T]]:
    """Split scalars into lists, one for each array."""
    arrays, begin = [], 0
    for shape in shapes:
        size = int(np.prod(shape))
        arrays.append(list(scalars[begin : begin + size]))
        begin += size
    return arrays


def squeezed(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape of an array in C, where one element is a number."""
    return tuple(n for n in shape if n > 1)


def base_of(texts: Sequence[str | None], shape: tuple[int, ...]) -> str | None:
    """Return the array of C whose elements are exactly these, in order, or None."""
    if not texts or texts[0] is None:
        return None
    first = "[0]" * len(shape)
    base = texts[0].removesuffix(first)
    if base == texts[0] or not re.fullmatch(r"[\w>.\-]+(\[\d+\])*", base):
        return None
    elements = [base + "".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]
    return base if list(texts) == elements else None


def column_of(texts: Sequence[str]) -> tuple[str, str] | None:
    """Return what is before and after the index of elements of an array of C that differ in one
    index, from zero on, or None."""
    if not re.fullmatch(r"[\w>.\-]+(\[\d+\])+", texts[0]):
        return None
    for place in re.finditer(r"\[0\]", texts[0]):
        begin, end = texts[0][: place.start()], texts[0][place.end() :]
        if all(text == f"{begin}[{i}]{end}" for i, text in enumerate(texts)):
            return begin, end
    return None


def has_rows(base: str, shape: tuple[int, ...], shapes: Mapping[str, tuple[int, ...]]) -> bool:
    """Whether the rows of an array, one of `shapes` by name, are known to be no longer than those
    of this shape, which begin at its start."""
    name, *indices = base.split("[")
    full_shape = shapes.get(name)
    return full_shape is not None and full_shape[len(indices) + 1 :] == shape[1:]


def _callers_first(root: Function, sites: dict[int, list[tuple[Function, Call]]]) -> list[Function]:
    order: list[Function] = []
    visited: set[int] = set()

    def visit(function: Function) -> None:
        visited.add(id(function))
        for call in function.block.calls():
            if call.function.source is not None:
                sites.setdefault(id(call.function), []).append((function, call))
                if id(call.function) not in visited:
                    visit(call.function)
        order.append(function)

    visit(root)
    return order[::-1]


def _context(
    function: Function,
    sites: list[tuple[Function, Call]],
    by_identity: Mapping[int, Context],
    trace: Trace,
) -> Context:
    source = function.source
    assert source is not None
    context = Context(function, results=[False] * len(source.results))
    if source.loop:
        return context
    params = arrays_in(function.params, source.params)
    arguments = [arrays_in(call.args, source.params) for _, call in sites]
    for number, array in enumerate(params):
        texts = {
            tuple(_text(x, by_identity[id(caller)].expressions) for x in args[number])
            for (caller, _), args in zip(sites, arguments, strict=True)
        }
        one = texts.pop()
        if not texts and all(text is not None and text.startswith(READ) for text in one):
            context.expressions.update((x.number, text) for x, text in zip(array, one, strict=True))  # pyright: ignore
    context.wishes = [_wish(args[0], trace, by_identity[id(sites[0][0])]) for args in arguments[0]]
    for array, wish in zip(params, context.wishes, strict=True):
        trace.names.update((x.number, wish) for x in array)  # pyright: ignore
    results = arrays_in(function.results, source.results)
    if len(sites) == 1:
        caller, call = sites[0]
        outs = arrays_in(call.outs, source.results)
        every = zip(outs, results, source.results, strict=True)
        context.results = [
            _keep(context, by_identity[id(caller)].places, out, result, squeezed(shape))
            for out, result, shape in every
        ]
    return context


def _keep(
    context: Context, places: Mapping[int, str], outs, results, shape: tuple[int, ...]
) -> bool:
    """Write an array of results where the caller keeps it, if it does so."""
    texts = [places.get(out.number) for out in outs]
    if any(text is None for text in texts) or (shape and base_of(texts, shape) is None):
        return False
    parameters = {param.number for param in context.function.params}
    for x, text in zip(results, texts, strict=True):
        assert text is not None
        if isinstance(x, Value) and x.number not in context.places and x.number not in parameters:
            context.places[x.number] = text
        else:
            context.assignments.append((text, x))
    return True


def _wish(x: Scalar, trace: Trace, caller: Context) -> str:
    """Return the name of an argument: of a field its last word."""
    text = caller.expressions.get(x.number) if isinstance(x, Value) else None
    if text is not None:
        return text.split("[")[0].split("->")[-1]
    return name_of(trace, x, "given")


def _text(x: Scalar, texts: Mapping[int, str]) -> str | None:
    return texts.get(x.number) if isinstance(x, Value) else None
