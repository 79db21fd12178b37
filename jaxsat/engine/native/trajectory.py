"""A trajectory's program as four stages: begin, advance, finish, observe.

What makes a case (its dispersed loop) is computed once, at its beginning. Numbers of it that are
the same in all cases stay uniform, and those known when lowering stay constants.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.extend.core import ClosedJaxpr
from jaxtyping import PyTree

from jaxsat.engine.native import rules
from jaxsat.engine.native.builder import Builder
from jaxsat.engine.native.ir import Function, Scalar, Value
from jaxsat.engine.native.lowering import arrays_of, lower, scalars_of
from jaxsat.engine.native.stages import Number, PerCase, Place, Shared, Slot, Stage
from jaxsat.engine.program import AbstractCopies, Copy, Program
from jaxsat.engine.scan import advance_one, begin_one, finish_one, observe_one

del rules  # imported for the table it fills

ALIGNMENT = 128


class Made(AbstractCopies):
    """The one copy that has been made already."""

    copy: Copy

    def __call__(self, case: PyTree, gains: PyTree) -> Copy:
        """The copy, whatever the case."""
        del case, gains
        return self.copy


@dataclass(frozen=True)
class Slots:
    """What becomes of the results of `begin`: the value that other stages see, and its place."""

    known: list[Scalar | None]
    places: list[Place]
    uniform: list[bool]


@dataclass(frozen=True)
class TrajectoryStages:
    """The stages, the bytes of a vector's state, and the arrays that go in and come out.

    Arrays are numbered in the order: those of cases, of the program, of the gains, the outputs,
    the signals.
    """

    stages: list[Stage]
    state_size: int
    outputs: PyTree
    signals: PyTree
    jaxprs: dict[str, ClosedJaxpr]


class _State:
    """Hands out places in the state."""

    def __init__(self, lanes: int):
        self.lanes = lanes
        self.size = 0

    def slot(self, dtype: np.dtype, uniform: bool) -> Slot:
        room = dtype.itemsize if uniform else dtype.itemsize * self.lanes
        slot = Slot(self.size, uniform)
        self.size += -(-room // ALIGNMENT) * ALIGNMENT
        return slot


def trajectory_stages(
    engine: Any, program: Program, case: PyTree, gains: PyTree, lanes: int
) -> TrajectoryStages:
    """The stages by which `engine` runs `program`; `case` and `gains` are examples."""
    numbers, static = eqx.partition((engine, program), eqx.is_array)
    made: list[Any] = []

    def begin(case, numbers, gains):
        copy = eqx.combine(numbers, static)[1].copies(case, gains)
        arrays, rest = eqx.partition(copy, eqx.is_array)
        made.append(rest)
        return arrays, begin_one(*_with_copy(numbers, static, copy), None, None)

    def of_copy(one: Callable):
        def stage(arrays, progress, numbers, *rest):
            engine, program = _with_copy(numbers, static, eqx.combine(arrays, made[0]))
            return one(engine, program, None, None, progress, *rest)

        return stage

    count = [len(jax.tree.leaves(tree)) for tree in (case, numbers, gains)]
    jaxprs: dict[str, ClosedJaxpr] = {}
    jaxprs["begin"], begun = jax.make_jaxpr(begin, return_shape=True)(case, numbers, gains)
    whole = jax.ShapeDtypeStruct((), np.dtype(int))
    jaxprs["advance"] = jax.make_jaxpr(of_copy(advance_one))(*begun, numbers, whole, whole)
    finish, observe = of_copy(finish_one), of_copy(observe_one)
    jaxprs["finish"], outputs = jax.make_jaxpr(finish, return_shape=True)(*begun, numbers)
    jaxprs["observe"], signals = jax.make_jaxpr(observe, return_shape=True)(*begun, numbers, whole)

    state = _State(lanes)
    inputs = _outer_places(jaxprs["begin"], count)
    first, slots = _begin_stage(jaxprs["begin"], inputs, state, len(jax.tree.leaves(begun[0])))
    shared = inputs[len(_elements(jaxprs["begin"].in_avals[: count[0]])) :]
    shared = shared[: len(_elements(jaxprs["begin"].in_avals[count[0] : sum(count[:2])]))]
    n_outputs = len(jax.tree.leaves(outputs))
    kept = len(jaxprs["begin"].out_avals) - len(jax.tree.leaves(begun[0]))
    later = [
        _stage(
            "advance",
            jaxprs["advance"],
            slots,
            shared,
            slots.places[-_size(jaxprs["begin"].out_avals[-kept:]) :],
        ),
        _stage(
            "finish", jaxprs["finish"], slots, shared, _out_places(jaxprs["finish"], sum(count))
        ),
        _stage(
            "observe",
            jaxprs["observe"],
            slots,
            shared,
            _out_places(jaxprs["observe"], sum(count) + n_outputs),
        ),
    ]
    return TrajectoryStages([first, *later], state.size, outputs, signals, jaxprs)


def _with_copy(numbers, static, copy: Copy) -> tuple[Any, Program]:
    engine, program = eqx.combine(numbers, static)
    return engine, eqx.tree_at(lambda program: program.copies, program, Made(copy))


def _elements(avals: Sequence[Any]) -> list[tuple[int, int, int, np.dtype]]:
    """Array, element, size and type of every scalar of arrays."""
    return [
        (array, element, int(np.prod(aval.shape)), np.dtype(aval.dtype))
        for array, aval in enumerate(avals)
        for element in range(int(np.prod(aval.shape)))
    ]


def _size(avals: Sequence[Any]) -> int:
    return len(_elements(avals))


def _outer_places(jaxpr: ClosedJaxpr, count: Sequence[int]) -> list[Place]:
    return [
        PerCase(array, element, size) if array < count[0] else Shared(array, element)
        for array, element, size, _ in _elements(jaxpr.in_avals)
    ]


def _out_places(jaxpr: ClosedJaxpr, first: int) -> list[Place]:
    return [
        PerCase(first + array, element, size)
        for array, element, size, _ in _elements(jaxpr.out_avals)
    ]


def _begin_stage(jaxpr, inputs: list[Place], state: _State, copies: int) -> tuple[Stage, Slots]:
    """The first stage, and where the copy (the first outputs) and the progress are afterwards."""
    params = [
        Value(dtype, isinstance(place, Shared))
        for place, (*_, dtype) in zip(inputs, _elements(jaxpr.in_avals), strict=True)
    ]
    b = Builder()
    shapes = [aval.shape for aval in jaxpr.in_avals]
    found = lower(b, jaxpr, arrays_of(params, shapes))
    of_copy, of_progress = scalars_of(found[:copies]), scalars_of(found[copies:])
    where = {param.number: place for param, place in zip(params, inputs, strict=True)}
    slots = Slots([], [], [])
    results, outputs = [], []
    for number, scalar in enumerate([*of_copy, *of_progress]):
        place = where.get(scalar.number) if isinstance(scalar, Value) else None
        constant = number < len(of_copy) and not isinstance(scalar, Value)
        uniform = number < len(of_copy) and isinstance(scalar, Value) and scalar.uniform
        if number < len(of_copy) and isinstance(place, Shared):
            slot = place
        elif constant:
            slot = Slot(-1, True)  # nowhere
        else:
            slot = state.slot(scalar.dtype, uniform)
            results.append(scalar)
            outputs.append(slot)
        slots.known.append(scalar if constant else None)
        slots.places.append(slot)
        slots.uniform.append(uniform)
    return Stage(Function("begin", params, b.block, results), inputs, outputs).swept(), slots


def _stage(
    name: str, jaxpr: ClosedJaxpr, slots: Slots, shared: list[Place], outputs: list[Place]
) -> Stage:
    """A stage after the first, whose inputs are the state, the program's numbers and a, b."""
    scalars: list[Scalar] = []
    params: list[Value] = []
    inputs: list[Place] = []
    free = iter(["a", "b"])
    for number, (*_, dtype) in enumerate(_elements(jaxpr.in_avals)):
        if number < len(slots.known):
            known, place = slots.known[number], slots.places[number]
            uniform = slots.uniform[number]
        else:
            known, uniform = None, True
            after = number - len(slots.known)
            place = shared[after] if after < len(shared) else Number(next(free))
        if known is None:
            known = Value(dtype, uniform)
            params.append(known)
            inputs.append(place)
        scalars.append(known)
    b = Builder()
    shapes = [aval.shape for aval in jaxpr.in_avals]
    results = scalars_of(lower(b, jaxpr, arrays_of(scalars, shapes)))
    return Stage(Function(name, params, b.block, results), inputs, outputs).swept()
