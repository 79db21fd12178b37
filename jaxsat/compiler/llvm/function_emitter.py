"""Programs as LLVM text: vectors for varying values, scalars for uniform ones.

Floating-point operations carry no flag, so LLVM changes no bit of them. In a module that `fuses`, a
product that only a sum of its own block needs becomes one operation with it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.llvm.emitter import (
    COLD,
    AbstractEmitter,
    Module,
    constant,
    conversion,
    extract,
    insert,
    memory_type,
    scalar_type,
    suffix,
    type_of,
    vector_of,
)
from jaxsat.compiler.llvm.locations import CONTEXT, Places, rematerialise
from jaxsat.compiler.operations import OPERATIONS
from jaxsat.compiler.passes.scheduling import fused_products

DOUBLE = np.dtype(np.float64)

RANGE = {"min": 4, "max": 5}
"""Operand of AVX-512's instruction `vrangepd` for the least or largest, with its sign."""

RANGE_LANES = 8
"""Number of doubles in an AVX-512 register."""

SHORT = 64
"""Largest number of lines of an internal function that LLVM writes out at its calls.

A call stores all vectors that are in registers. Code of one lane, which has few, keeps its calls,
for it is compiled sooner.
"""


def internal(module: Module, function: ir.Function, places: Places) -> tuple[str, bool]:
    """Return the name of an internal function, printed once, and whether it needs the arena.

    It reads parameters that have `places` itself.
    """
    entry = module.printed.get(id(function))
    if entry is None:
        name, number = f'@"{function.name}"', 0
        text, in_arena = _printed(module, name, function, places)
        while module.functions.setdefault(name, text) != text:
            number += 1  # another function has the name
            name = f'@"{function.name}.{number}"'
            text, in_arena = _printed(module, name, function, places)
        entry = module.printed[id(function)] = (name, function, in_arena)
    return entry[0], entry[2]


def _printed(module: Module, name: str, function: ir.Function, places: Places) -> tuple[str, bool]:
    body = FunctionEmitter(module)
    params = [CONTEXT] if places else []
    for param in function.params:
        if param.number in places:
            rematerialise(body, param, places[param.number])
        else:
            params.append(f"{type_of(param, module.lanes)} {body.name(param)}")
    body.program(function)
    results = [body.operand(result) for result in function.results]
    body.line(f"ret {aggregate(body, function.results, results)}")
    if body.in_arena:
        params.append("ptr noalias %arena")
    returned = result_type(function.results, module.lanes)
    lines = body.text()
    short = " alwaysinline" * (module.lanes > 1 and len(lines) <= SHORT)
    head = f"define internal {returned} {name}({', '.join(params)}){short} #0 {{"
    return "\n".join([head, *lines, "}"]), body.in_arena


def result_type(results: Sequence[ir.Scalar], lanes: int) -> str:
    """Return the return type of a function: one value, or a structure of several."""
    types = [type_of(result, lanes) for result in results]
    return types[0] if len(types) == 1 else f"{{ {', '.join(types)} }}"


def aggregate(body: AbstractEmitter, results: Sequence[ir.Scalar], names: Sequence[str]) -> str:
    """Return type and name of all results put together."""
    types = [type_of(result, body.module.lanes) for result in results]
    if len(types) == 1:
        return f"{types[0]} {names[0]}"
    whole, before = result_type(results, body.module.lanes), "poison"
    for number, (kind, name) in enumerate(zip(types, names, strict=True)):
        after = body.fresh()
        body.line(f"{after} = insertvalue {whole} {before}, {kind} {name}, {number}")
        before = after
    return f"{whole} {before}"


class FunctionEmitter(AbstractEmitter):
    """Lines of one function, step by step; parameters with `places` are not passed."""

    def __init__(self, module: Module, places: Mapping[int, Places] | None = None):
        super().__init__(module)
        self.places = places or {}
        self._reads: Counter[int] = Counter()  # of values, in a module that fuses

    def program(self, function: ir.Function) -> None:
        """Print all steps of a function."""
        if self.module.fuses:
            self._reads.update(chain(ir.reads(function.block), ir.numbers_of(function.results)))
        self.steps(function.block)

    def steps(self, block: ir.Block) -> None:
        """Print the steps of a block."""
        fused = fused_products(block.steps, self._reads)
        within = {product.out.number for product in fused.values()}
        for step in block.steps:
            match step:
                case ir.Operation(out=out) if out.number in within:
                    pass
                case ir.Operation(out=out) if out.number in fused:
                    self._fused(step, fused[out.number])
                case ir.Operation():
                    self._operation(step)
                case ir.Load():
                    self._load(step)
                case ir.Store():
                    self._store(step)
                case ir.Loop():
                    self._loop(step)
                case ir.BlockSwitch():
                    self._switch(step)
                case ir.Call():
                    self._call(step)

    def _operation(self, step: ir.Operation) -> None:
        lanes = None if step.out.uniform else self.module.lanes
        out, name = self.name(step.out), step.name
        if name == "any":
            self._any(out, step.args[0])
            return
        wide = lanes is not None
        args = [self.operand(x, wide) for x in step.args]
        if name == "select":
            args[0] = self.operand(step.args[0])
        types = [self.kind(x.dtype, wide) for x in step.args]
        match name:
            case "select":
                chooser = type_of(step.args[0], self.module.lanes)
                typed = f"{chooser} {args[0]}, {types[1]} {args[1]}, {types[2]} {args[2]}"
                self.line(f"{out} = select {typed}")
            case "convert":
                self._convert(out, args[0], step.args[0].dtype, step.out.dtype, wide)
            case "bitcast":
                to = self.kind(step.out.dtype, wide)
                self.line(f"{out} = bitcast {types[0]} {args[0]} to {to}")
            case _:
                self._arithmetic(out, name, step.args[0].dtype, args, types[0], lanes)

    def _fused(self, step: ir.Operation, product: ir.Operation) -> None:
        """Print a sum or difference as one operation with a product that it reads."""
        lanes = None if step.out.uniform else self.module.lanes
        kind, (one, other) = type_of(step.out, self.module.lanes), step.args
        rest = other if one is product.out else one
        x, y, z = (self.operand(arg, lanes is not None) for arg in (*product.args, rest))
        if step.name == "sub":
            negative = self.fresh()
            self.line(f"{negative} = fneg {kind} {z if one is product.out else x}")
            x, z = (x, negative) if one is product.out else (negative, z)
        self._arithmetic(self.name(step.out), "fma", step.out.dtype, [x, y, z], kind, lanes)

    def _arithmetic(self, out, name, dtype, args, kind, lanes) -> None:
        word = OPERATIONS[name].word(dtype)
        if word is None:
            raise ir.NativeBug("printing", f"no {name} of {dtype} numbers")
        if name in RANGE and dtype == DOUBLE and lanes == RANGE_LANES and self.module.masks:
            self._extremum(out, name, args, kind)
        elif word.startswith("llvm."):
            full = f"@{word}.{suffix(dtype, lanes)}"
            self.module.declarations.add(f"declare {kind} {full}({', '.join([kind] * len(args))})")
            typed = ", ".join(f"{kind} {arg}" for arg in args)
            self.line(f"{out} = call {kind} {full}({typed})")
        else:
            self.line(f"{out} = {word} {kind} {', '.join(args)}")

    def _extremum(self, out: str, name: str, args: Sequence[str], kind: str) -> None:
        """Print the extremum of vectors of doubles by `vrangepd`, in half of LLVM's own steps.

        It orders zeros correctly, but of a number and NaN it returns the number.
        """
        ranged, nans = self.fresh(), self.fresh()
        full, bits = "@llvm.x86.avx512.mask.range.pd.512", f"<{RANGE_LANES} x i1>"
        self.module.declarations.add(f"declare {kind} {full}({kind}, {kind}, i32, {kind}, i8, i32)")
        typed = f"{kind} {args[0]}, {kind} {args[1]}, i32 {RANGE[name]}, {kind} zeroinitializer"
        self.line(f"{ranged} = call {kind} {full}({typed}, i8 -1, i32 4)")
        self.line(f"{nans} = fcmp uno {kind} {args[0]}, {args[1]}")
        nan = f"{kind} splat (double {constant(DOUBLE.type(np.nan))})"
        self.line(f"{out} = select {bits} {nans}, {nan}, {kind} {ranged}")

    def _any(self, out: str, predicate: ir.Scalar) -> None:
        lanes = self.module.lanes
        bits = self.fresh()
        self.line(
            f"{bits} = bitcast {vector_of('i1', lanes)} {self.operand(predicate)} to i{lanes}"
        )
        self.line(f"{out} = icmp ne i{lanes} {bits}, 0")

    def _convert(self, out: str, x: str, old: np.dtype, new: np.dtype, wide: bool) -> None:
        before, after = self.kind(old, wide), self.kind(new, wide)
        if old.kind == "f" and new.kind in "iu":
            word = "llvm.fptosi.sat" if new.kind == "i" else "llvm.fptoui.sat"
            lanes = self.module.lanes if wide else None
            full = f"@{word}.{suffix(new, lanes)}.{suffix(old, lanes)}"
            self.module.declarations.add(f"declare {after} {full}({before})")
            self.line(f"{out} = call {after} {full}({before} {x})")
            return
        self.line(f"{out} = {conversion(old, new)} {before} {x} to {after}")

    def _call(self, step: ir.Call) -> None:
        places = self.places.get(id(step.function), {})
        name, in_arena = internal(self.module, step.function, places)
        passed = [CONTEXT.replace("noalias ", "")] if places else []
        for param, arg in zip(step.function.params, step.args, strict=True):
            if param.number not in places:
                kind = type_of(param, self.module.lanes)
                passed.append(f"{kind} {self.operand(arg, not param.uniform)}")
        if in_arena:
            self.in_arena = True
            passed.append("ptr %arena")
        typed = ", ".join(passed)
        returned = result_type(step.function.results, self.module.lanes)
        if len(step.outs) == 1:
            self.line(f"{self.name(step.outs[0])} = call {returned} {name}({typed})")
            return
        whole = self.fresh()
        self.line(f"{whole} = call {returned} {name}({typed})")
        for number, out in enumerate(step.outs):
            self.line(f"{self.name(out)} = extractvalue {returned} {whole}, {number}")

    def _loop(self, step: ir.Loop) -> None:
        entry, number = self.label, self.fresh("")[1:]
        head, work, out = f"head{number}", f"work{number}", f"out{number}"
        before = self._operands(step.before, step.params)
        self.line(f"br label %{head}")
        self.begin(head)
        place = len(self.written)
        self.spread.append({})
        self.steps(step.condition)
        going = self.operand(step.active)
        if not ir.is_uniform(step.active):
            going = self.fresh()
            self._any(going, step.active)
        self.line(f"br i1 {going}, label %{work}, label %{out}")
        self.begin(work)
        self.spread.append({})
        self.steps(step.body)
        after = self._operands(step.after, step.params)
        self.spread[-2:] = []
        last = self.label
        self.line(f"br label %{head}")
        self.written[place:place] = [
            f"{self.name(p)} = phi {self.kind(p.dtype, not p.uniform)} "
            f"[ {b}, %{entry} ], [ {a}, %{last} ]"
            for p, b, a in zip(step.params, before, after, strict=True)
        ]
        self.begin(out)

    def _operands(self, scalars: Sequence[ir.Scalar], to: Sequence[ir.Value]) -> list[str]:
        return [self.operand(x, not out.uniform) for x, out in zip(scalars, to, strict=True)]

    def _switch(self, step: ir.BlockSwitch) -> None:
        number = self.fresh("")[1:]
        labels = [f"case{number}.{i}" for i in range(len(step.blocks))]
        out, kind = f"out{number}", scalar_type(step.index.dtype)
        targets = " ".join(f"{kind} {i}, label %{label}" for i, label in enumerate(labels[1:], 1))
        index = self.operand(step.index)
        weights = f", !prof {COLD}" if step.cold else ""
        self.line(f"switch {kind} {index}, label %{labels[0]} [ {targets} ]{weights}")
        sources = []
        for label, block, results in zip(labels, step.blocks, step.yields, strict=True):
            self.begin(label)
            self.spread.append({})
            self.steps(block)
            operands = self._operands(results, step.outs)
            self.spread.pop()
            sources.append((operands, self.label))
            self.line(f"br label %{out}")
        self.begin(out)
        for i, value in enumerate(step.outs):
            pairs = ", ".join(f"[ {operands[i]}, %{label} ]" for operands, label in sources)
            self.line(f"{self.name(value)} = phi {type_of(value, self.module.lanes)} {pairs}")

    def _store(self, step: ir.Store) -> None:
        wide = not step.memory.uniform
        value = self.operand(step.value, wide)
        self.put(self.address(step.memory, step.index), value, step.memory.dtype, wide)

    def _load(self, step: ir.Load) -> None:
        if ir.is_uniform(step.index):
            place = self.address(step.memory, step.index)
            self.get(self.name(step.out), place, step.memory.dtype, not step.memory.uniform)
            return
        self.gather(step)

    def gather(self, step: ir.Load) -> None:
        """Load every lane's own element, lane by lane."""
        memory, lanes = step.memory, self.module.lanes
        index, kind = self.operand(step.index), memory_type(memory.dtype)
        number, base = scalar_type(step.index.dtype), self.memory(memory)
        cells, whole = vector_of(kind, lanes), "poison"
        for lane in range(lanes):
            i, place, one, more = self.fresh(), self.fresh("p"), self.fresh(), self.fresh()
            self.line(f"{i} = {extract(number, lanes, index, lane)}")
            if memory.uniform or lanes == 1:
                self.line(f"{place} = getelementptr {kind}, ptr {base}, {number} {i}")
            else:
                self.line(f"{place} = getelementptr {cells}, ptr {base}, {number} {i}, i64 {lane}")
            self.line(f"{one} = load {kind}, ptr {place}")
            self.line(f"{more} = {insert(kind, lanes, whole, one, lane)}")
            whole = more
        out = self.name(step.out)
        if memory.dtype.kind == "b":
            self.line(f"{out} = icmp ne {cells} {whole}, zeroinitializer")
        else:
            self.line(f"{out} = bitcast {cells} {whole} to {cells}")
