"""Lowering of a trajectory's entry points.

Numbers that are equal in all cases stay uniform from one entry point to the next, and numbers known
at lowering stay constants.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler import rules
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, Scalar, Value
from jaxsat.compiler.llvm.arguments import Arguments
from jaxsat.compiler.llvm.emitter import ALIGNMENT
from jaxsat.compiler.llvm.entry_points import EntryPoint
from jaxsat.compiler.llvm.locations import Location, PerCase, ScalarArgument, SharedElement, Slot
from jaxsat.compiler.lowering import Elements, arrays_of, lower, number_type, scalars_of
from jaxsat.core.jaxprs import Jaxpr, jaxpr_and_shapes
from jaxsat.core.process import no_collection
from jaxsat.simulation.engine.native.phases import AbstractPhases, zero_leaves
from jaxsat.simulation.engine.progress import Progress

del rules  # imported for its registrations


@dataclass(frozen=True)
class LoweredTrajectory:
    """The entry points, the bytes of a vector's state, and the shapes of the results.

    External arrays are numbered in this order: those of cases, of the program, of the gains (the
    `arguments`), the outputs, the observations. Where every trajectory has its own pace, `going` is
    the location of the bytes in the state that mark unfinished lanes. `behind` is true if signals
    lie behind the state, see `interface.stops`.
    """

    entry_points: list[EntryPoint]
    state_size: int
    arguments: Arguments
    outputs: PyTree
    signals: PyTree
    jaxprs: dict[str, Jaxpr]
    going: int | None
    behind: bool


@dataclass(frozen=True)
class _Source:
    """Source of a scalar for an entry point: a constant, or a location."""

    dtype: np.dtype
    constant: Scalar | None = None
    location: Location | None = None
    uniform: bool = True


@no_collection()
def lower_trajectory(
    phases: AbstractPhases, numbers: PyTree, case: PyTree, gains: PyTree, lanes: int
) -> LoweredTrajectory:
    """The entry points of a trajectory; `numbers`, `case` and `gains` are examples."""
    whole = jax.ShapeDtypeStruct((), np.dtype(int))
    numbers = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype), numbers)
    jaxprs: dict[str, Jaxpr] = {}

    def traced(name: str, function: Callable, *examples: PyTree) -> PyTree:
        jaxprs[name], shape = jaxpr_and_shapes(function, *examples)
        return shape

    fixed, moving = traced("begin", phases.begin, case, numbers, gains)
    n_case, n_numbers = len(jax.tree.leaves(case)), len(jax.tree.leaves(numbers))
    n_inputs = len(jaxprs["begin"].in_avals)
    outside = _outside(jaxprs["begin"].in_avals, n_case)
    state = _State(lanes)
    begin, sources, fixed_elements = _begin(
        jaxprs["begin"], outside, len(jax.tree.leaves(fixed)), state
    )
    phases.learn(zero_leaves([list(array.flat) for array in fixed_elements]))
    progress = (fixed, moving)
    onwards = "attempt" if phases.paced else "advance"
    traced(onwards, getattr(phases, onwards), *progress, numbers, whole, whole)
    outputs = traced("finish", phases.finish, *progress, numbers, whole, whole)
    signals = traced("observe", phases.observe, *progress, numbers, whole)

    first = _count(jaxprs["begin"].in_avals[:n_case])
    of_program = outside[first : first + _count(jaxprs["begin"].in_avals[n_case:][:n_numbers])]
    moves = [source.location for source in sources[-_count(jaxprs[onwards].out_avals) :]]
    n_outputs = len(jaxprs["finish"].out_avals)
    locations: dict[str, list[Location]] = {
        onwards: [location for location in moves if location is not None],
        "finish": _results(jaxprs["finish"].out_avals, n_inputs),
        "observe": _results(jaxprs["observe"].out_avals, n_inputs + n_outputs),
    }
    going = None
    if phases.paced:
        traced("going", phases.going, *progress, numbers, whole, whole)
        slot = state.slot(np.dtype(bool), False)
        where: list[Location] = [slot]
        locations["going"], going = where, slot.offset
    inputs = [*sources, *of_program]
    later = {name: _later(name, jaxprs[name], inputs, where) for name, where in locations.items()}
    advance = later.pop(onwards)
    others = [entry.optimised() for entry in later.values()]
    read_later = {place for entry in others for place in entry.inputs}
    advance = advance.with_needed_results(read_later).optimised()
    trees = {"cases": case, "numbers": jax.tree.leaves(numbers), "gains": gains}
    arguments = Arguments.of(trees, jaxprs["begin"].in_avals, "cases")
    return LoweredTrajectory(
        [begin, *others, advance],
        state.size,
        arguments,
        outputs,
        signals,
        jaxprs,
        going,
        isinstance(moving, Progress) and moving.sums is not None,
    )


def numbers_of(stepper: PyTree, program: PyTree) -> PyTree:
    """All numbers of a stepper and of a program."""
    return eqx.filter((stepper, program), eqx.is_array)


class _State:
    """Allocator of locations in the state."""

    def __init__(self, lanes: int):
        self.lanes = lanes
        self.size = 0

    def slot(self, dtype: np.dtype, uniform: bool) -> Slot:
        room = dtype.itemsize if uniform else dtype.itemsize * self.lanes
        slot = Slot(self.size, uniform)
        self.size += -(-room // ALIGNMENT) * ALIGNMENT
        return slot


def _elements(avals: Sequence[Any]) -> Iterator[tuple[int, int, int, np.dtype]]:
    """Array, element, size and type of every scalar of arrays."""
    for array, aval in enumerate(avals):
        size = int(np.prod(aval.shape))
        for element in range(size):
            yield array, element, size, number_type(aval.dtype)


def _count(avals: Sequence[Any]) -> int:
    return sum(int(np.prod(aval.shape)) for aval in avals)


def _outside(avals: Sequence[Any], n_case: int) -> list[_Source]:
    return [
        _Source(dtype, None, PerCase(array, element, size), False)
        if array < n_case
        else _Source(dtype, None, SharedElement(array, element), True)
        for array, element, size, dtype in _elements(avals)
    ]


def _results(avals: Sequence[Any], first: int) -> list[Location]:
    return [PerCase(first + array, element, size) for array, element, size, _ in _elements(avals)]


def _begin(
    jaxpr: Jaxpr, outside: list[_Source], n_fixed: int, state: _State
) -> tuple[EntryPoint, list[_Source], list[Elements]]:
    """The first entry point, the locations of its results, and the fixed part."""
    params = [Value(source.dtype, source.uniform) for source in outside]
    where = dict(zip((param.number for param in params), outside, strict=True))
    b = Builder()
    b.outside = _arrays_outside(params, [source.location for source in outside])
    arrays = arrays_of(params, [aval.shape for aval in jaxpr.in_avals])
    elements = lower(b, jaxpr, arrays)
    fixed, moving = scalars_of(elements[:n_fixed]), scalars_of(elements[n_fixed:])
    sources, results, outputs = [], [], []
    for number, scalar in enumerate([*fixed, *moving]):
        stays, variable = number < len(fixed), isinstance(scalar, Value)
        source = where.get(scalar.number) if isinstance(scalar, Value) else None
        if stays and not variable:
            sources.append(_Source(scalar.dtype, scalar))
        elif stays and source is not None and source.uniform:
            sources.append(source)
        else:
            uniform = stays and isinstance(scalar, Value) and scalar.uniform
            slot = state.slot(scalar.dtype, uniform)
            results.append(scalar)
            outputs.append(slot)
            sources.append(_Source(scalar.dtype, None, slot, uniform))
    locations = [source.location for source in outside if source.location is not None]
    entry = EntryPoint(Function("begin", params, b.block, results), locations, outputs)
    return entry.optimised(), sources, elements[:n_fixed]


def _later(name: str, jaxpr: Jaxpr, sources: list[_Source], outputs: list[Location]) -> EntryPoint:
    """An entry point after the first; inputs without a source are the numbers a and b."""
    scalars, params, locations = [], [], []
    free = iter(["a", "b"])
    for number, (*_, dtype) in enumerate(_elements(jaxpr.in_avals)):
        after = number >= len(sources)
        source = _Source(dtype, None, ScalarArgument(next(free))) if after else sources[number]
        scalar = source.constant
        if source.location is not None:
            scalar = Value(dtype, source.uniform)
            params.append(scalar)
            locations.append(source.location)
        scalars.append(scalar)
    b = Builder()
    b.outside = _arrays_outside(params, locations)
    arrays = arrays_of(scalars, [aval.shape for aval in jaxpr.in_avals])
    results = scalars_of(lower(b, jaxpr, arrays))
    return EntryPoint(Function(name, params, b.block, results), locations, outputs)


def _arrays_outside(
    params: Sequence[Value], locations: Sequence[Location | None]
) -> dict[int, list[Value]]:
    """The values of arrays that are the same for all cases, by the number of the first, in order.

    A value out of order, or a missing one, ends an array.
    """
    arrays: dict[int, list[Value]] = {}
    number, values = -1, []
    for param, location in zip(params, locations, strict=True):
        if isinstance(location, SharedElement):
            if location.element == 0:
                number, values = location.array, []
                arrays[param.number] = values
            if location.array == number and location.element == len(values):
                values.append(param)
    return arrays
