"""How often a loop turns: flight code needs a bound that is known before."""

from collections.abc import Mapping
from typing import NamedTuple

from jaxsat.compiler.ir import Loop, Operation, Scalar, Value


class Bound(NamedTuple):
    """Of a loop that counts up: which param counts, where it ends (exclusive), and whether that is
    the loop's whole condition."""

    counter: int
    end: int
    is_whole: bool


def bound_of(step: Loop, makers: Mapping[int, Operation]) -> Bound | None:
    """The bound of a loop that counts up from a constant to another; None of any other."""
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
                whole = isinstance(step.active, Value) and step.active.number == name
                return Bound(i, int(maker.args[1]), whole)  # pyright: ignore
    return None


def _conjuncts(active: Scalar, makers: Mapping[int, Operation]) -> list[int]:
    """Numbers of the conditions that must all hold."""
    if not isinstance(active, Value):
        return []
    maker = makers.get(active.number)
    if maker is not None and maker.name == "and":
        return [number for arg in maker.args for number in _conjuncts(arg, makers)]
    return [active.number]
