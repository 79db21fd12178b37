"""Loops that count up to a constant, and ranges of integers in them."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jaxsat.compiler.ir import Loop, Operation, Scalar, Value
from jaxsat.compiler.passes.ranges import NONE, Bounds, Ranges, united


class CountedLoop(NamedTuple):
    """A loop that counts up: counter's index, exclusive end, and number of the testing value."""

    counter: int
    end: int
    test: int


def bound_of(step: Loop, makers: Mapping[int, Operation]) -> CountedLoop | None:
    """Return the bound of a loop that counts up from a constant to another, else None."""
    for name in _conjuncts(step.active, makers):
        maker = makers.get(name)
        if maker is None or maker.name != "lt" or isinstance(maker.args[1], Value):
            continue
        for i, (param, before, after) in enumerate(
            zip(step.params, step.before, step.after, strict=True)
        ):
            turn = makers.get(after.number) if isinstance(after, Value) else None
            counts = (
                maker.args[0] is param
                and not isinstance(before, Value)
                and turn is not None
                and turn.name == "add"
                and turn.args[0] is param
                and not isinstance(turn.args[1], Value)
                and turn.args[1] == 1
            )
            if counts:
                return CountedLoop(i, int(maker.args[1]), name)  # pyright: ignore
    return None


def _conjuncts(active: Scalar, makers: Mapping[int, Operation]) -> list[int]:
    """Return the numbers of the conditions that must all hold."""
    if not isinstance(active, Value):
        return []
    maker = makers.get(active.number)
    if maker is not None and maker.name == "and":
        return [number for arg in maker.args for number in _conjuncts(arg, makers)]
    return [active.number]


def ranges_in(step: Loop, ranges: Ranges) -> dict[int, tuple[Bounds, Bounds]]:
    """Return the ranges of params of a counted loop in its body and after it, by index.

    They are those of integers that begin with a constant and never decrease, as the counter, and of
    integers that are chosen among known ones. `ranges` are those of other numbers.
    """
    both = (*step.condition.steps, *step.body.steps)
    makers = {one.out.number: one for one in both if isinstance(one, Operation)}
    bound = bound_of(step, makers)
    if bound is None:
        return {}
    turns = max(0, bound.end - int(step.before[bound.counter]))  # pyright: ignore
    bounds: dict[int, tuple[Bounds, Bounds]] = {}
    for i, (param, before, after) in enumerate(
        zip(step.params, step.before, step.after, strict=True)
    ):
        if param.dtype.kind not in "iu" or isinstance(before, Value):
            continue
        begin = int(before)
        most = _most_added(after, param, makers)
        last = begin + turns * (most or 0)
        if most is not None and last <= np.iinfo(param.dtype).max:
            bounds[i] = (begin, max(begin, last - most)), (begin, last)
    inside = {step.params[i].number: within for i, (within, _) in bounds.items()}
    for i, (param, before, after) in enumerate(
        zip(step.params, step.before, step.after, strict=True)
    ):
        first = ranges.of(before)
        if param.dtype.kind in "iu" and i not in bounds and first is not None:
            choice = _chosen(after, param, makers, ranges, inside)
            if choice is not None:
                bounds[i] = (united(first, choice), united(first, choice))
    return bounds


def _chosen(
    x: Scalar,
    param: Value,
    makers: Mapping[int, Operation],
    ranges: Ranges,
    inside: Mapping[int, Bounds],
) -> Bounds | None:
    """Return the range of what is chosen among a param and known numbers, or None."""
    if x is param:
        return NONE
    if isinstance(x, Value) and x.number in inside:
        return inside[x.number]
    maker = makers.get(x.number) if isinstance(x, Value) else None
    if maker is None or maker.name != "select":
        return ranges.of(x)
    parts = [_chosen(part, param, makers, ranges, inside) for part in maker.args[1:]]
    return None if parts[0] is None or parts[1] is None else united(parts[0], parts[1])


def _most_added(x: Scalar, param: Value, makers: Mapping[int, Operation]) -> int | None:
    """Return the most by which a value is above a param, if it is never below; else None."""
    if x is param:
        return 0
    maker = makers.get(x.number) if isinstance(x, Value) else None
    if maker is None or maker.name not in ("add", "select"):
        return None
    if maker.name == "select":
        parts = [_most_added(part, param, makers) for part in maker.args[1:]]
        return None if None in parts else max(part for part in parts if part is not None)
    one, other = maker.args
    added = None if isinstance(other, Value) else int(other)
    most = _most_added(one, param, makers)
    return None if most is None or added is None or added < 0 else most + added
