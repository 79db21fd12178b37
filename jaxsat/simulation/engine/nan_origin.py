"""Which operation of a function makes the NaN that it returns.

The function is traced and computed one operation after the other, but for passes of loops that make
no new NaN, and every NaN is followed from where it arises. The derivative of a program is a
function like any other: `jax.jvp` inside it is traced too, and its operations come from the source
lines of those that they are derivatives of.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.jax_internals import (
    CALL,
    ClosedJaxpr,
    Expanded,
    JaxprEqn,
    Literal,
    Place,
    jaxpr_as_fun,
    layout_of,
    place_of,
)


class Origin(NamedTuple):
    """What makes a NaN: an operation by the name of its primitive, and the calls in the source from
    the outermost; or the leaf of the function's arguments by its number, where it was given."""

    operation: str
    place: tuple[Place, ...] = ()
    argument: int | None = None


class _Value(NamedTuple):
    """An array, and where its NaN is from; None where it has none."""

    array: Any
    origin: Origin | None = None


def nan_origins(function: Callable, *arguments: PyTree) -> list[Origin | None]:
    """Where the NaN of each leaf of a function's result is from; None for a leaf without."""
    program = jax.make_jaxpr(function)(*arguments)
    leaves = jax.tree.leaves(arguments)
    given = [_told(leaf, Origin("", (), number)) for number, leaf in enumerate(leaves)]
    return [value.origin for value in _computed(program, given)]


def _told(array: Any, origin: Origin | None) -> _Value:
    """A value that is from there, if it is NaN."""
    return _Value(array, origin if _has_nan(array) else None)


def _has_nan(array: Any) -> bool:
    real = jnp.issubdtype(jnp.result_type(array), jnp.inexact)
    return bool(real and np.isnan(np.asarray(array)).any())


def _computed(program: Any, given: Sequence[_Value]) -> list[_Value]:
    """What a program makes of values."""
    closed = program.jaxpr if isinstance(program, Expanded) else program
    inner = closed.jaxpr if isinstance(closed, ClosedJaxpr) else closed
    constants = [_told(x, Origin("constant")) for x in getattr(closed, "consts", ())]
    known = dict(zip((*inner.constvars, *inner.invars), (*constants, *given), strict=True))

    def read(atom: Any) -> _Value:
        if isinstance(atom, Literal):
            return _told(atom.val, Origin("constant"))
        return known[atom]

    for equation in inner.eqns:
        made = _made(equation, [read(atom) for atom in equation.invars])
        known.update(zip(equation.outvars, made, strict=True))
    return [read(atom) for atom in inner.outvars]


def _made(equation: JaxprEqn, given: list[_Value]) -> list[_Value]:
    name, parameters, unknown = layout_of(equation)
    if name == CALL and not unknown:
        return _computed(parameters["body"], given)
    if name in _LOOPS and not unknown:
        return _LOOPS[name](parameters, given)
    found = equation.primitive.bind(*[value.array for value in given], **equation.params)
    found = found if equation.primitive.multiple_results else [found]
    if not any(map(_has_nan, found)):
        return [_Value(array) for array in found]
    origin = _first(name, found, given)
    if origin is None or origin.operation == "constant":
        origin = Origin(name, place_of(equation.source_info))
    return [_told(array, origin) for array in found]


def _first(name: str, found: list[Any], given: list[_Value]) -> Origin | None:
    """Where the NaN of an operation's result is from, if it was there before."""
    if name == "select_n":
        which, *cases = given
        chosen = np.asarray(which.array).astype(int)
        nan = np.isnan(np.asarray(found[0]))
        given = [case for number, case in enumerate(cases) if np.any(nan & (chosen == number))]
    return next((value.origin for value in given if value.origin is not None), None)


class _Repeated:
    """The body of a loop. From the second pass on it is compiled, and only a pass that makes a new
    NaN is computed bit by bit."""

    def __init__(self, body: ClosedJaxpr):
        self.body, self._compiled, self._first = body, jax.jit(jaxpr_as_fun(body)), True

    def __call__(self, given: list[_Value], before: Sequence[Origin | None]) -> list[_Value]:
        """One pass; `before` tells where the NaN of each result of the last pass was from."""
        if self._first:
            self._first = False
            return _computed(self.body, given)
        found = self._compiled(*[value.array for value in given])
        if any(map(_is_new, found, before)):
            return _computed(self.body, given)
        return [_told(array, origin) for array, origin in zip(found, before, strict=True)]


def _is_new(array: Any, before: Origin | None) -> bool:
    return before is None and _has_nan(array)


def _scan(parameters: Any, given: list[_Value]) -> list[_Value]:
    body, length, consts = parameters["body"], parameters["length"], parameters["n_consts"]
    end = consts + parameters["n_carry"]
    made, rows = given[consts:end], []
    once = _Repeated(body)
    before = [value.origin for value in made] + [None] * (len(body.out_avals) - len(made))
    order = range(length)
    for number in reversed(order) if parameters["reverse"] else order:
        row = [_told(x.array[number], x.origin) for x in given[end:]]
        made = once([*given[:consts], *made[: end - consts], *row], before)
        before = [value.origin for value in made]
        rows.append(made[end - consts :])
    if parameters["reverse"]:
        rows.reverse()
    return [*made[: end - consts], *map(_stacked, zip(*rows, strict=True))]


def _stacked(rows: Sequence[_Value]) -> _Value:
    origin = next((row.origin for row in rows if row.origin is not None), None)
    return _Value(jnp.stack([row.array for row in rows]), origin)


def _while(parameters: Any, given: list[_Value]) -> list[_Value]:
    begin = parameters["n_test"]
    end = begin + parameters["n_body"]
    carry, once = given[end:], _Repeated(parameters["body"])
    goes_on = jax.jit(jaxpr_as_fun(parameters["test"]))
    while bool(goes_on(*[value.array for value in (*given[:begin], *carry)])[0]):
        carry = once([*given[begin:end], *carry], [value.origin for value in carry])
    return carry


def _cond(parameters: Any, given: list[_Value]) -> list[_Value]:
    branches = parameters["branches"]
    number = min(max(int(given[0].array), 0), len(branches) - 1)
    return _computed(branches[number], given[1:])


_LOOPS: dict[str, Callable[[Any, list[_Value]], list[_Value]]] = {
    "scan": _scan,
    "while": _while,
    "cond": _cond,
}
