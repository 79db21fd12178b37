"""A stage: a program whose inputs and outputs have places in memory, as one exported function.

A stage is called for one vector of trajectories as

    void stage(pointers, state, cases, wanted, a, b)

`pointers` holds the address of the arena (`lines.Module`) and of every array from outside; `state`
is memory of this vector alone; `cases` gives the number of every lane's case and `wanted` (bytes)
tells the lanes for which something is to be written; `a` and `b` are whole numbers for all lanes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.engine.native.builder import is_uniform
from jaxsat.engine.native.ir import Function, Operation, Scalar, Sweep, Value
from jaxsat.engine.native.lines import Module
from jaxsat.engine.native.llvm import Body
from jaxsat.engine.native.lowering import bugs_in
from jaxsat.engine.native.ordering import in_order
from jaxsat.engine.native.places import (
    FROM,
    Known,
    Number,
    PerCase,
    Place,
    Shared,
    Slot,
    array_of,
    known_to_functions,
    read_later,
)
from jaxsat.engine.native.seldom import gather
from jaxsat.engine.native.words import memory_type, scalar_type, suffix, vector_type


@dataclass
class Stage:
    """A program and the places of its parameters and results."""

    function: Function
    inputs: list[Place]
    outputs: list[Place]

    @bugs_in("removing and ordering steps")
    def swept(self) -> "Stage":
        """Without the steps whose results nobody uses."""
        sweep = Sweep()
        sweep.need(self.function.results)
        sweep.block(self.function.block)
        gather(self.function.block)
        in_order(self.function.block, self.function.results)
        keep = [param.number in sweep.used for param in self.function.params]
        params = [p for p, used in zip(self.function.params, keep, strict=True) if used]
        inputs = [place for place, used in zip(self.inputs, keep, strict=True) if used]
        function = Function(self.function.name, params, self.function.block, self.function.results)
        return Stage(function, inputs, self.outputs)


@bugs_in("printing")
def add_stage(module: Module, stage: Stage) -> None:
    """Print a stage into a module."""
    inputs = list(zip(stage.function.params, stage.inputs, strict=True))
    places = {x.number: place for x, place in inputs if isinstance(place, Shared | Slot)}
    body = _StageBody(module, known_to_functions(stage.function.block, places))
    for param, place in inputs:
        body.read(param, place)
    body.steps(stage.function.block)
    moved = [
        (result, place)
        for result, place in zip(stage.function.results, stage.outputs, strict=True)
        if not (isinstance(result, Value) and places.get(result.number) == place)
    ]
    chosen = {
        step.out.number: step
        for step in stage.function.block.steps
        if isinstance(step, Operation) and step.name == "select"
    }
    masked = [(*_new(result, place, places, chosen), place) for result, place in moved]
    for result, conditions, _ in masked:
        for scalar in (result, *conditions):
            body.operand(scalar)  # read before anything is written
    for result, conditions, place in masked:
        body.write(result, conditions, place)
    body.line("ret void")
    lines = body.text()
    if body.in_arena:
        lines.insert(1, "%arena = load ptr, ptr %pointers")
    head = (
        f"define void @{stage.function.name}({FROM}, "
        "ptr noalias %cases, ptr noalias %wanted, i64 %a, i64 %b) noinline #0 {"
    )
    module.functions[stage.function.name] = "\n".join([head, *lines, "}"])


def _new(
    result: Scalar, place: Place, places: Mapping[int, Place], chosen: Mapping[int, Operation]
) -> tuple[Scalar, list[Scalar]]:
    """What is new of a result where several conditions hold: elsewhere its place stays as it is."""
    conditions: list[Scalar] = []
    while isinstance(result, Value) and result.number in chosen:
        condition, yes, no = chosen[result.number].args
        if not (isinstance(no, Value) and places.get(no.number) == place):
            break
        if is_uniform(condition):
            break
        conditions.append(condition)
        result = yes
    return result, conditions


class _StageBody(Body):
    """A body that can read and write places."""

    def __init__(self, module: Module, known: Mapping[int, Known]):
        super().__init__(module, known)
        lanes = module.lanes
        self.line(f"%number = load <{lanes} x i64>, ptr %cases, align 64")
        self.line(f"%bytes = load <{lanes} x i8>, ptr %wanted, align 1")
        self.line(f"%lane = icmp ne <{lanes} x i8> %bytes, zeroinitializer")

    def read(self, param: Value, place: Place) -> None:
        """Give a parameter its value, now or where it is needed."""
        match place:
            case Number(name=name):
                kind = scalar_type(param.dtype)
                word = "bitcast" if kind == "i64" else "trunc"
                self.line(f"{self.name(param)} = {word} i64 %{name} to {kind}")
            case PerCase():
                self._gather(self.name(param), param.dtype, place)
            case _:
                read_later(self, param, place)

    def _gather(self, out: str, dtype: np.dtype, place: PerCase) -> None:
        lanes, kind = self.module.lanes, memory_type(dtype)
        cells, name = f"<{lanes} x {kind}>", f"@gather.{kind}"
        index, base = self._indices(place), array_of(self, place.array)
        self.module.functions.setdefault(name, _gather_text(name, kind, lanes))
        found = out if dtype.kind != "b" else self.fresh()
        self.line(f"{found} = call {cells} {name}(ptr {base}, <{lanes} x i64> {index})")
        if dtype.kind == "b":
            self.line(f"{out} = icmp ne {cells} {found}, zeroinitializer")

    def _indices(self, place: PerCase) -> str:
        wide = f"<{self.module.lanes} x i64>"
        scaled, moved = self.fresh(), self.fresh()
        self.line(f"{scaled} = mul {wide} %number, splat (i64 {place.size})")
        self.line(f"{moved} = add {wide} {scaled}, splat (i64 {place.element})")
        return moved

    def _lanes(self, conditions: Sequence[Scalar]) -> str:
        """The wanted lanes in which conditions hold."""
        mask, bits = "%lane", f"<{self.module.lanes} x i1>"
        for condition in conditions:

            def both(out: str, mask: str = mask, condition: Scalar = condition) -> None:
                self.line(f"{out} = and {bits} {mask}, {self.operand(condition)}")

            assert isinstance(condition, Value)
            mask = self.once_in_block((mask, condition.number), both)
        return mask

    def write(self, result: Scalar, conditions: Sequence[Scalar], place: Place) -> None:
        """Put a result where it belongs, for the wanted lanes in which conditions hold."""
        dtype, lanes = result.dtype, self.module.lanes
        wide = vector_type(dtype, lanes)
        if isinstance(place, Slot):
            where = self.fresh("p")
            self.line(f"{where} = getelementptr i8, ptr %state, i64 {place.offset}")
            if place.uniform:
                self.put(where, self.operand(result), dtype, False)
                return
            self._put_some(where, result, f"<{lanes} x i1> {self._lanes(conditions)}")
            return
        assert isinstance(place, PerCase)
        kind = memory_type(dtype)
        value, name = self.operand(result, True), f"@scatter.{kind}"
        if dtype.kind == "b":
            byte = self.fresh()
            self.line(f"{byte} = zext {wide} {value} to <{lanes} x i8>")
            value = byte
        index, base = self._indices(place), array_of(self, place.array)
        self.module.functions.setdefault(name, _scatter_text(name, kind, lanes))
        self.line(
            f"call void {name}(ptr {base}, <{lanes} x i64> {index}, "
            f"<{lanes} x {kind}> {value}, <{lanes} x i1> %lane)"
        )

    def _put_some(self, where: str, result: Scalar, lane: str) -> None:
        """Write the lanes of a vector that `lane` tells."""
        dtype, lanes = result.dtype, self.module.lanes
        wide = vector_type(dtype, lanes)
        value = f"{wide} {self.operand(result, True)}"
        if self.module.masks and dtype.itemsize == 8:
            name = f"@llvm.masked.store.{suffix(dtype, lanes)}.p0"
            kinds = f"{wide}, ptr, i32, <{lanes} x i1>"
            self.module.declarations.add(f"declare void {name}({kinds})")
            self.line(f"call void {name}({value}, ptr {where}, i32 64, {lane})")
            return
        old, new = self.fresh(), self.fresh()
        self.get(old, where, dtype, True)
        self.line(f"{new} = select {lane}, {value}, {wide} {old}")
        self.put(where, new, dtype, True)


def _gather_text(name: str, kind: str, lanes: int) -> str:
    cells = f"<{lanes} x {kind}>"
    lines = [f"define internal {cells} {name}(ptr %base, <{lanes} x i64> %index) noinline #0 {{"]
    whole = "poison"
    for lane in range(lanes):
        lines += [
            f"%i{lane} = extractelement <{lanes} x i64> %index, i64 {lane}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = load {kind}, ptr %p{lane}",
            f"%w{lane} = insertelement {cells} {whole}, {kind} %x{lane}, i64 {lane}",
        ]
        whole = f"%w{lane}"
    return "\n".join([*lines, f"ret {cells} {whole}", "}"])


def _scatter_text(name: str, kind: str, lanes: int) -> str:
    cells = f"<{lanes} x {kind}>"
    lines = [
        f"define internal void {name}(ptr %base, <{lanes} x i64> %index, {cells} %value, "
        f"<{lanes} x i1> %lane) noinline #0 {{"
    ]
    for lane in range(lanes):
        lines += [
            f"%b{lane} = extractelement <{lanes} x i1> %lane, i64 {lane}",
            f"br i1 %b{lane}, label %put{lane}, label %next{lane}",
            f"put{lane}:",
            f"%i{lane} = extractelement <{lanes} x i64> %index, i64 {lane}",
            f"%p{lane} = getelementptr {kind}, ptr %base, i64 %i{lane}",
            f"%x{lane} = extractelement {cells} %value, i64 {lane}",
            f"store {kind} %x{lane}, ptr %p{lane}",
            f"br label %next{lane}",
            f"next{lane}:",
        ]
    return "\n".join([*lines, "ret void", "}"])
