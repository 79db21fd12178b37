"""An entry point: a program as one exported function, with locations of its inputs and outputs.

An entry point is called for one vector of trajectories as

    void entry_point(pointers, state, cases, wanted, a, b)

`pointers` holds the address of the arena (`emitter.Module`) and of every array from outside;
`state` is memory of this vector alone; `cases` gives the number of every lane's case and `wanted`
(bytes) tells the lanes for which something is to be written; `a` and `b` are whole numbers for all
lanes. Nothing is computed for a single lane that is not wanted.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.llvm.drivers import copy_text, gather_text, scatter_text
from jaxsat.compiler.llvm.emitter import (
    ALIGNMENT,
    Module,
    memory_type,
    scalar_type,
    splat,
    suffix,
    vector_of,
    vector_type,
)
from jaxsat.compiler.llvm.function_emitter import FunctionEmitter
from jaxsat.compiler.llvm.locations import (
    CONTEXT,
    Location,
    PerCase,
    Places,
    ScalarArgument,
    SharedElement,
    Slot,
    array_pointer,
    parameter_locations,
    rematerialise,
)
from jaxsat.compiler.lowering import bugs_in
from jaxsat.compiler.passes.dead_code import DeadCodeElimination, dependencies, reachable
from jaxsat.compiler.passes.scheduling import merge_cold_branches, move_invariants, schedule

ONCE = ("begin", "finish")
"""Entry points that run once for each case. LLVM does not optimise them for a single lane, which
has the same bits and takes it less time than all that these then run longer."""


@dataclass
class EntryPoint:
    """A program and the locations of its parameters and results."""

    function: ir.Function
    inputs: list[Location]
    outputs: list[Location]

    def with_needed_results(self, locations: Container[Location]) -> "EntryPoint":
        """Without results that only they themselves need when it is called again and again.

        Those in `locations` are needed, and those in the locations of parameters that they need.
        """
        pairs = list(zip(self.function.results, self.outputs, strict=True))
        new = {place: ir.numbers_of([result]) for result, place in pairs}
        needs = dependencies(self.function.block)
        params = list(zip(self.function.params, self.inputs, strict=True))
        for param, place in params:
            needs[param.number] += new.get(place, [])
        outputs = [result for result, place in pairs if place in locations]
        live = reachable(needs, ir.numbers_of(outputs))
        again = {place for param, place in params if param.number in live}
        keep = [place in locations or place in again for place in self.outputs]
        results = list(compress(self.function.results, keep))
        return EntryPoint(
            replace(self.function, results=results), self.inputs, list(compress(self.outputs, keep))
        )

    @bugs_in("optimisation")
    def optimised(self) -> "EntryPoint":
        """Without dead code, invariants before loops, cold branches merged, steps scheduled."""
        elimination = DeadCodeElimination(self.function.block, self.function.results)
        move_invariants(self.function.block)
        merge_cold_branches(self.function.block)
        schedule(self.function.block, self.function.results)
        keep = [param.number in elimination.live for param in self.function.params]
        function = replace(self.function, params=list(compress(self.function.params, keep)))
        return EntryPoint(function, list(compress(self.inputs, keep)), self.outputs)


@bugs_in("printing")
def emit_entry_point(module: Module, entry: EntryPoint) -> None:
    """Print an entry point into a module."""
    inputs = list(zip(entry.function.params, entry.inputs, strict=True))
    locations = {
        x.number: location for x, location in inputs if isinstance(location, SharedElement | Slot)
    }
    body = _EntryPointEmitter(module, parameter_locations(entry.function.block, locations))
    moves = [
        (result, location)
        for result, location in zip(entry.function.results, entry.outputs, strict=True)
        if not (isinstance(result, ir.Value) and locations.get(result.number) == location)
    ]
    of_cases = {x.number: place for x, place in inputs if isinstance(place, PerCase)}
    copies, moves = _copies(moves, of_cases)
    used = {number for step in entry.function.block.steps for number in ir.uses(step)}
    used.update(ir.numbers_of(result for result, _ in moves))
    for param, location in inputs:
        if param.number not in of_cases or param.number in used:
            body.read(param, location)
    body.program(entry.function)
    selections = {
        step.out.number: step
        for step in entry.function.block.steps
        if isinstance(step, ir.Operation) and step.name == "select"
    }
    masked = [_new(result, location, locations, selections) for result, location in moves]
    for result, conditions, _ in masked:
        for scalar in (result, *conditions):
            body.operand(scalar)  # read before anything is written
    body.write(masked)
    for kind, place, slot, count in copies:
        body.copy(kind, place, slot, count)
    body.line("ret void")
    lines = body.text()
    if body.in_arena:
        lines.insert(1, "%arena = load ptr, ptr %pointers")
    name = entry.function.name
    quick = " optnone" if module.lanes == 1 and name in ONCE else ""
    head = (
        f"define void @{name}({CONTEXT}, ptr noalias %cases, ptr noalias %wanted, "
        f"i64 %a, i64 %b) noinline{quick} #0 {{"
    )
    module.functions[name] = "\n".join([head, *lines, "}"])


_Copy = tuple[str, PerCase, Slot, int]
"""Numbers of a type in memory, where the first is, where it goes, and how many follow each other"""


_Written = tuple[ir.Scalar, list[ir.Scalar], Location]
"""A result, the conditions under which it is new, and its location"""


def _copies(
    moves: Sequence[tuple[ir.Scalar, Location]], of_cases: Mapping[int, PerCase]
) -> tuple[list[_Copy], list[tuple[ir.Scalar, Location]]]:
    """What an entry point only copies from arrays of cases into the state, row by row; the rest."""
    copies: list[_Copy] = []
    rest = []
    for result, location in moves:
        source = of_cases.get(result.number) if isinstance(result, ir.Value) else None
        if source is None or not isinstance(location, Slot):
            rest.append((result, location))
            continue
        kind = memory_type(result.dtype)
        if copies:
            _, first, slot, count = copies[-1]
            further = replace(first, element=first.element + count)
            if source == further and location.offset == slot.offset + count * ALIGNMENT:
                copies[-1] = (kind, first, slot, count + 1)
                continue
        copies.append((kind, source, location, 1))
    return copies, rest


def _new(
    result: ir.Scalar,
    location: Location,
    locations: Mapping[int, Location],
    selections: Mapping[int, ir.Operation],
) -> _Written:
    """What is new of a result where several conditions hold; elsewhere its location is kept."""
    conditions: list[ir.Scalar] = []
    while isinstance(result, ir.Value) and result.number in selections:
        condition, yes, no = selections[result.number].args
        if not (isinstance(no, ir.Value) and locations.get(no.number) == location):
            break
        if ir.is_uniform(condition):
            break
        conditions.append(condition)
        result = yes
    return result, conditions, location


class _EntryPointEmitter(FunctionEmitter):
    """Emits a function that reads and writes locations."""

    def __init__(self, module: Module, places: Mapping[int, Places]):
        super().__init__(module, places)
        lanes = module.lanes
        bytes_ = vector_of("i8", lanes)
        self.line(f"%number = load {vector_of('i64', lanes)}, ptr %cases, align 64")
        self.line(f"%bytes = load {bytes_}, ptr %wanted, align 1")
        self.line(f"%lane = icmp ne {bytes_} %bytes, zeroinitializer")
        if lanes == 1:
            self.line("br i1 %lane, label %whole, label %nothing")
            self.begin("nothing")
            self.line("ret void")
            self.begin("whole")

    def read(self, param: ir.Value, location: Location) -> None:
        """Give a parameter its value, now or where it is needed."""
        match location:
            case ScalarArgument(name=name):
                kind = scalar_type(param.dtype)
                word = "bitcast" if kind == "i64" else "trunc"
                self.line(f"{self.name(param)} = {word} i64 %{name} to {kind}")
            case PerCase():
                self._gather(self.name(param), param.dtype, location)
            case _:
                rematerialise(self, param, location)

    def _gather(self, out: str, dtype: np.dtype, location: PerCase) -> None:
        lanes, kind = self.module.lanes, memory_type(dtype)
        cells, name = vector_of(kind, lanes), f"@gather.{kind}"
        index, base = self._indices(location), array_pointer(self, location.array)
        self.module.functions.setdefault(name, gather_text(name, kind, lanes))
        cell = out if dtype.kind != "b" else self.fresh()
        self.line(f"{cell} = call {cells} {name}(ptr {base}, {vector_of('i64', lanes)} {index})")
        if dtype.kind == "b":
            self.line(f"{out} = icmp ne {cells} {cell}, zeroinitializer")

    def copy(self, kind: str, source: PerCase, slot: Slot, count: int) -> None:
        """Copy elements of an array of cases that follow each other, for the selected lanes."""
        lanes, name, gather = self.module.lanes, f"@copy.{kind}", f"@gather.{kind}"
        self.module.functions.setdefault(gather, gather_text(gather, kind, lanes))
        self.module.functions.setdefault(name, copy_text(name, kind, lanes))
        index, base = self._indices(source), array_pointer(self, source.array)
        where = self.fresh("p")
        self.line(f"{where} = getelementptr i8, ptr %state, i64 {slot.offset}")
        self.line(
            f"call void {name}(ptr {base}, {vector_of('i64', lanes)} {index}, ptr {where}, "
            f"i64 {count}, {vector_of('i1', lanes)} %lane)"
        )

    def _indices(self, location: PerCase) -> str:
        lanes, wide = self.module.lanes, vector_of("i64", self.module.lanes)
        scaled, index = self.fresh(), self.fresh()
        self.line(f"{scaled} = mul {wide} %number, {splat(f'i64 {location.size}', lanes)}")
        self.line(f"{index} = add {wide} {scaled}, {splat(f'i64 {location.element}', lanes)}")
        return index

    def _lanes(self, conditions: Sequence[ir.Scalar]) -> str:
        """The selected lanes in which conditions hold."""
        mask, bits = "%lane", vector_of("i1", self.module.lanes)
        for condition in conditions:

            def both(out: str, mask: str = mask, condition: ir.Scalar = condition) -> None:
                self.line(f"{out} = and {bits} {mask}, {self.operand(condition)}")

            assert isinstance(condition, ir.Value)
            mask = self.once_in_block((mask, condition.number), both)
        return mask

    def write(self, results: Sequence[_Written]) -> None:
        """Put results where they belong, for the selected lanes in which their conditions hold.

        For a single lane there is one jump over all results of the same conditions.
        """
        if self.module.lanes > 1:
            for one in results:
                self._write(*one)
            return
        groups: dict[tuple[int, ...], list[_Written]] = {}
        for one in results:
            groups.setdefault(tuple(ir.numbers_of(one[1])), []).append(one)
        for group in groups.values():
            number, conditions = self.fresh("")[1:], group[0][1]
            if conditions:
                lane = self._lanes(conditions)
                self.line(f"br i1 {lane}, label %new{number}, label %old{number}")
                self.begin(f"new{number}")
            for result, _, location in group:
                self._write(result, (), location)
            if conditions:
                self.line(f"br label %old{number}")
                self.begin(f"old{number}")

    def _write(
        self, result: ir.Scalar, conditions: Sequence[ir.Scalar], location: Location
    ) -> None:
        dtype, lanes = result.dtype, self.module.lanes
        wide = vector_type(dtype, lanes)
        if isinstance(location, Slot):
            where = self.fresh("p")
            self.line(f"{where} = getelementptr i8, ptr %state, i64 {location.offset}")
            if location.uniform or lanes == 1:
                self.put(where, self.operand(result), dtype, False)
                return
            self._put_some(where, result, f"{vector_of('i1', lanes)} {self._lanes(conditions)}")
            return
        assert isinstance(location, PerCase)
        kind = memory_type(dtype)
        value, name = self.operand(result, True), f"@scatter.{kind}"
        if dtype.kind == "b":
            byte = self.fresh()
            self.line(f"{byte} = zext {wide} {value} to {vector_of('i8', lanes)}")
            value = byte
        index, base = self._indices(location), array_pointer(self, location.array)
        self.module.functions.setdefault(name, scatter_text(name, kind, lanes))
        self.line(
            f"call void {name}(ptr {base}, {vector_of('i64', lanes)} {index}, "
            f"{vector_of(kind, lanes)} {value}, {vector_of('i1', lanes)} %lane)"
        )

    def _put_some(self, where: str, result: ir.Scalar, lane: str) -> None:
        """Write the lanes of a vector that `lane` tells."""
        dtype, lanes = result.dtype, self.module.lanes
        wide = vector_type(dtype, lanes)
        value = f"{wide} {self.operand(result, True)}"
        if self.module.masks and dtype.itemsize == 8:
            name = f"@llvm.masked.store.{suffix(dtype, lanes)}.p0"
            kinds = f"{wide}, ptr, i32, {vector_of('i1', lanes)}"
            self.module.declarations.add(f"declare void {name}({kinds})")
            self.line(f"call void {name}({value}, ptr {where}, i32 64, {lane})")
            return
        old, new = self.fresh(), self.fresh()
        self.get(old, where, dtype, True)
        self.line(f"{new} = select {lane}, {value}, {wide} {old}")
        self.put(where, new, dtype, True)
