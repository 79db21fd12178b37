"""Rules of loops and branches, and analysis of arrays that differ from lane to lane.

A carry of a loop may begin the same in all lanes and come out of the body different; so loops are
analysed to a fixed point. Arrays count as wholes: one varying element makes all vary.
"""

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Memory, Scalar, Value, is_uniform
from jaxsat.compiler.lowering import (
    Elements,
    arrays_of,
    each,
    equations,
    lower,
    lowers,
    number_type,
    scalars_of,
)
from jaxsat.compiler.operations import BOOL, INT
from jaxsat.compiler.rules.elementwise import extremum
from jaxsat.compiler.rules.indexing import element, is_given, memory_of, stored
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal
from jaxsat.core.once import latest

UNROLLED = 64
"""Largest number of equations of a scan that is unrolled."""


def _varies(array: Elements) -> bool:
    return not all(map(is_uniform, array.flat))


@lowers("while")
def _while(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    n_test, n_body = eqn.parameters["n_test"], eqn.parameters["n_body"]
    test, body = eqn.parameters["test"], eqn.parameters["body"]
    of_test, of_body = arrays[:n_test], arrays[n_test : n_test + n_body]
    carries = list(arrays[n_test + n_body :])
    varying, condition_varies = while_carries(eqn, [_varies(x) for x in arrays])
    changing = [i for i, same in enumerate(unchanged(body, n_body)) if not same]
    shapes = [carries[i].shape for i in changing]
    uniform = [not varying[i] for i in changing for _ in range(carries[i].size)]

    def at(scalars: list[Scalar]) -> list[Elements]:
        now = list(carries)
        for i, array in zip(changing, arrays_of(scalars, shapes), strict=True):
            now[i] = array
        return now

    batched = test.out_avals[0].ndim

    def active(scalars) -> Elements:
        return lower(b, test, [*of_test, *at(scalars)])[0]

    def condition(scalars):
        return reduce(lambda x, y: b.operation("or", x, y), active(scalars).flat, np.False_)

    def step(scalars):
        after = lower(b, body, [*of_body, *at(scalars)])
        if batched:  # rows of a mapped loop end one by one
            going, now = active(scalars), at(scalars)
            after = [_where_going(b, going, x, y) for x, y in zip(after, now, strict=True)]
        return scalars_of([after[i] for i in changing])

    before = scalars_of([carries[i] for i in changing])
    return at(b.while_loop(before, uniform, condition, step, condition_varies))


def _where_going(b: Builder, going: Elements, after: Elements, now: Elements) -> Elements:
    wide = going.reshape(*going.shape, *[1] * (after.ndim - going.ndim))
    return each(b.select, np.broadcast_to(wide, after.shape), after, now)


@lowers("scan")
def _scan(b: Builder, eqn, *arrays: Elements) -> list[Elements]:
    length, body = eqn.parameters["length"], eqn.parameters["body"]
    if length == 1 or length * equations(body) <= UNROLLED:
        return _unrolled(b, eqn, arrays)
    n_consts, n_carry = eqn.parameters["n_consts"], eqn.parameters["n_carry"]
    consts, carries = arrays[:n_consts], arrays[n_consts : n_consts + n_carry]
    varying, stacked_vary = scan_outputs(eqn, [_varies(x) for x in arrays])
    rows = [_row_reader(b, x) for x in arrays[n_consts + n_carry :]]
    y_avals = [var.aval for var in eqn.outputs[n_carry:]]
    ys = [
        memory_of(number_type(aval.dtype), int(np.prod(aval.shape)), not vary)
        for aval, vary in zip(y_avals, stacked_vary, strict=True)
    ]
    shapes = [x.shape for x in carries]

    def condition(scalars):
        return b.operation("lt", scalars[0], INT.type(length))

    def step(scalars):
        number = scalars[0]
        where = number
        if eqn.parameters["reverse"]:
            where = b.operation("sub", INT.type(length - 1), number)
        parts = [row(where) for row in rows]
        after = lower(b, body, [*consts, *arrays_of(scalars[1:], shapes), *parts])
        for memory, part in zip(ys, after[n_carry:], strict=True):
            for k, scalar in enumerate(part.flat):
                b.store(memory, _element(b, where, part.size, k), scalar)
        return [b.operation("add", number, INT.type(1)), *scalars_of(after[:n_carry])]

    uniform = [True] + [
        not vary for x, vary in zip(carries, varying, strict=True) for _ in range(x.size)
    ]
    last = b.while_loop([INT.type(0), *scalars_of(carries)], uniform, condition, step, False)
    stacked = [_loaded(b, y, None, aval.shape) for y, aval in zip(ys, y_avals, strict=True)]
    return [*arrays_of(last[1:], shapes), *stacked]


def _unrolled(b: Builder, eqn, arrays: Sequence[Elements]) -> list[Elements]:
    n_consts, n_carry = eqn.parameters["n_consts"], eqn.parameters["n_carry"]
    consts, carries = arrays[:n_consts], list(arrays[n_consts : n_consts + n_carry])
    xs, length = arrays[n_consts + n_carry :], eqn.parameters["length"]
    order = range(length)
    rows: list[list[Elements] | None] = [None] * length
    for i in reversed(order) if eqn.parameters["reverse"] else order:
        parts = [x[i : i + 1].reshape(x.shape[1:]) for x in xs]
        after = lower(b, eqn.parameters["body"], [*consts, *carries, *parts])
        carries, rows[i] = after[:n_carry], after[n_carry:]
    if not length:
        return carries + [np.empty(var.aval.shape, object) for var in eqn.outputs[n_carry:]]
    return carries + [np.stack(column) for column in zip(*rows, strict=True)]  # pyright: ignore


def _element(b: Builder, row: Scalar | None, size: int, k: int) -> Scalar:
    if row is None:
        return INT.type(k)
    return b.operation("add", b.operation("mul", row, INT.type(size)), INT.type(k))


def _row_reader(b: Builder, x: Elements) -> Callable[[Scalar], Elements]:
    """Return a reader of the row of a number, which is in range."""
    shape = x.shape[1:]
    if not is_given(b, x):
        memory = stored(b, x)
        return lambda number: _loaded(b, memory, number, shape)
    columns = [list(x[(slice(None), *index)]) for index in np.ndindex(shape)]
    return lambda number: arrays_of([element(b, y, number) for y in columns], [shape])[0]


def _loaded(b: Builder, memory: Memory, row: Scalar | None, shape: tuple[int, ...]) -> Elements:
    size = int(np.prod(shape))
    scalars = [b.load(memory, _element(b, row, size, k)) for k in range(size)]
    return arrays_of(scalars, [shape])[0]


@lowers("cond")
def _cond(b: Builder, eqn, which: Elements, *arrays: Elements) -> list[Elements]:
    branches = eqn.parameters["branches"]
    index = which[()]
    index = b.convert(index, INT) if index.dtype == BOOL or index.dtype != INT else index
    if not (isinstance(index, Value) and index.number in b.truths and len(branches) == 2):
        last = INT.type(len(branches) - 1)
        index = extremum(b, "min", extremum(b, "max", index, INT.type(0)), last)
    shapes = [var.aval.shape for var in eqn.outputs]

    def taking(branch):
        return lambda: scalars_of(lower(b, branch, arrays))

    return arrays_of(b.switch(index, [taking(branch) for branch in branches]), shapes)


def varying_outputs(jaxpr: Jaxpr, varying: Sequence[bool]) -> list[bool]:
    """Return which outputs vary where these inputs do.

    It is memoised, as the loops around a loop ask the same of its body again and again.
    """
    return list(_varying_outputs(jaxpr, tuple(varying)))


@latest(1024)
def _varying_outputs(jaxpr: Jaxpr, varying: tuple[bool, ...]) -> tuple[bool, ...]:
    varies = dict(zip(jaxpr.inputs, varying, strict=True))

    def read(atom) -> bool:
        return False if isinstance(atom, Literal) else varies.get(atom, False)

    for eqn in jaxpr.equations:
        outputs = _outputs(eqn, [read(atom) for atom in eqn.inputs])
        varies.update(zip(eqn.outputs, outputs, strict=True))
    return tuple(read(atom) for atom in jaxpr.outputs)


def _outputs(eqn: Equation, varying: list[bool]) -> list[bool]:
    if eqn.name == "while" and not eqn.unknown:
        return while_carries(eqn, varying)[0]
    if eqn.name == "scan" and not eqn.unknown:
        carries, stacked = scan_outputs(eqn, varying)
        return carries + stacked
    if eqn.name == "cond" and not eqn.unknown:
        several = [varying_outputs(branch, varying[1:]) for branch in eqn.programs()]
        return [varying[0] or any(one) for one in zip(*several, strict=True)]
    if eqn.is_call:
        return varying_outputs(eqn.parameters["body"], varying)
    return [any(varying)] * len(eqn.outputs)


def while_carries(eqn: Equation, varying: Sequence[bool]) -> tuple[list[bool], bool]:
    """Return which carries of a `while` vary, and whether its condition does."""
    test, body = eqn.parameters["test"], eqn.parameters["body"]
    n_test, n_body = eqn.parameters["n_test"], eqn.parameters["n_body"]
    of_test, of_body = list(varying[:n_test]), list(varying[n_test : n_test + n_body])
    carries = list(varying[n_test + n_body :])
    while True:
        condition = varying_outputs(test, of_test + carries)[0]
        after = varying_outputs(body, of_body + carries)
        changed = [not same for same in unchanged(body, n_body)]
        widened = [
            old or new or (condition and changes)
            for old, new, changes in zip(carries, after, changed, strict=True)
        ]
        if widened == carries:
            return carries, condition
        carries = widened


def scan_outputs(eqn: Equation, varying: Sequence[bool]) -> tuple[list[bool], list[bool]]:
    """Return which carries and which stacked outputs of a `scan` vary."""
    body = eqn.parameters["body"]
    n_consts, n_carry = eqn.parameters["n_consts"], eqn.parameters["n_carry"]
    consts, xs = list(varying[:n_consts]), list(varying[n_consts + n_carry :])
    carries = list(varying[n_consts : n_consts + n_carry])
    while True:
        after = varying_outputs(body, consts + carries + xs)
        widened = [old or new for old, new in zip(carries, after[:n_carry], strict=True)]
        if widened == carries:
            return carries, after[n_carry:]
        carries = widened


def unchanged(body: Jaxpr, n_consts: int) -> list[bool]:
    """Return which carries a body passes on unchanged."""
    carries = body.inputs[n_consts:]
    return [out is carry for out, carry in zip(body.outputs, carries, strict=False)]
