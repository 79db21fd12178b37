"""Programs as LLVM code in text: vectors for varying values, scalars for uniform ones.

Floating-point operations carry the flag `contract` and no other: a product and a sum may become
one fused operation, and nothing else may change.
"""

from collections.abc import Sequence

import numpy as np

from jaxsat.engine.native.builder import is_uniform
from jaxsat.engine.native.ir import (
    Block,
    Call,
    Function,
    Load,
    Loop,
    Memory,
    Operation,
    Scalar,
    Store,
    Switch,
    Value,
)
from jaxsat.engine.native.operations import OPERATIONS
from jaxsat.engine.native.words import (
    constant,
    memory_type,
    scalar_type,
    suffix,
    type_of,
    vector_type,
)


class Module:
    """The text of a module: functions, constant arrays and declarations of what is used."""

    def __init__(self, lanes: int):
        self.lanes = lanes
        self.functions: dict[str, str] = {}
        self.constants: dict[int, str] = {}  # by the number of the memory
        self.declarations: set[str] = set()

    def text(self, attributes: str) -> str:
        """All of it, every function with these attributes."""
        parts = [*self.constants.values(), *self.functions.values(), *sorted(self.declarations)]
        return "\n".join([*parts, f"attributes #0 = {{ {attributes} }}", ""])

    def add(self, function: Function) -> str:
        """The name of an internal function, printed if it was not."""
        name = f'@"{function.name}"'
        if name not in self.functions:
            self.functions[name] = ""  # its place before those who call it
            self.functions[name] = self._internal(name, function)
        return name

    def _internal(self, name: str, function: Function) -> str:
        body = Body(self)
        params = [f"{type_of(param, self.lanes)} {body.name(param)}" for param in function.params]
        body.steps(function.block)
        results = [body.operand(result) for result in function.results]
        body.line(f"ret {aggregate(body, function.results, results)}")
        returned = result_type(function.results, self.lanes)
        head = f"define internal {returned} {name}({', '.join(params)}) #0 {{"
        return "\n".join([head, *body.text(), "}"])


def result_type(results: Sequence[Scalar], lanes: int) -> str:
    """What a function of these results returns: one value, or a structure of several."""
    types = [type_of(result, lanes) for result in results]
    return types[0] if len(types) == 1 else f"{{ {', '.join(types)} }}"


def aggregate(body: "Body", results: Sequence[Scalar], names: Sequence[str]) -> str:
    """Type and name of all results put together."""
    types = [type_of(result, body.module.lanes) for result in results]
    if len(types) == 1:
        return f"{types[0]} {names[0]}"
    whole, before = result_type(results, body.module.lanes), "poison"
    for number, (kind, name) in enumerate(zip(types, names, strict=True)):
        after = body.fresh()
        body.line(f"{after} = insertvalue {whole} {before}, {kind} {name}, {number}")
        before = after
    return f"{whole} {before}"


class Body:
    """The lines of one function while it is printed."""

    def __init__(self, module: Module):
        self.module = module
        self._lines: list[str] = []
        self._first: list[str] = []
        self._count = 0
        self._label = "entry"
        self._spread: list[dict[int | str, str]] = [{}]
        self._memories: dict[int, str] = {}
        self._names: dict[int, str] = {}

    def text(self) -> list[str]:
        """Its lines, room on the stack first."""
        return ["entry:", *self._first, *self._lines]

    def line(self, line: str) -> None:
        """One more."""
        self._lines.append(line)

    def fresh(self, prefix: str = "t") -> str:
        """A name that is not in use."""
        self._count += 1
        return f"%{prefix}{self._count}"

    def name(self, value: Value) -> str:
        """The name of a value of the program."""
        return self._names.setdefault(value.number, f"%v{len(self._names)}")

    def operand(self, x: Scalar, varying: bool = False) -> str:
        """A value or constant, spread over all lanes if it is to be `varying`."""
        if not isinstance(x, Value):
            if not varying:
                return constant(x)
            return f"splat ({scalar_type(x.dtype)} {constant(x)})"
        if not varying or not x.uniform:
            return self.name(x)
        for known in reversed(self._spread):
            if x.number in known:
                return known[x.number]
        wide = vector_type(x.dtype, self.module.lanes)
        one, all_ = self.fresh(), self.fresh()
        kind = scalar_type(x.dtype)
        self.line(f"{one} = insertelement {wide} poison, {kind} {self.name(x)}, i64 0")
        self.line(
            f"{all_} = shufflevector {wide} {one}, {wide} poison, "
            f"<{self.module.lanes} x i32> zeroinitializer"
        )
        self._spread[-1][x.number] = all_
        return all_

    def steps(self, block: Block) -> None:
        """The steps of a block."""
        for step in block.steps:
            match step:
                case Operation():
                    self._operation(step)
                case Load():
                    self._load(step)
                case Store():
                    self._store(step)
                case Loop():
                    self._loop(step)
                case Switch():
                    self._switch(step)
                case Call():
                    self._call(step)

    def _operation(self, step: Operation) -> None:
        lanes = None if step.out.uniform else self.module.lanes
        out, name = self.name(step.out), step.name
        if name == "any":
            self._any(out, step.args[0])
            return
        wide = lanes is not None
        args = [self.operand(x, wide) for x in step.args]
        if name == "select":
            args[0] = self.operand(step.args[0])
        types = [self._type(x.dtype, wide) for x in step.args]
        match name:
            case "select":
                chooser = type_of(step.args[0], self.module.lanes)
                typed = f"{chooser} {args[0]}, {types[1]} {args[1]}, {types[2]} {args[2]}"
                self.line(f"{out} = select {typed}")
            case "convert":
                self._convert(out, args[0], step.args[0].dtype, step.out.dtype, wide)
            case "bitcast":
                to = self._type(step.out.dtype, wide)
                self.line(f"{out} = bitcast {types[0]} {args[0]} to {to}")
            case _:
                self._arithmetic(out, name, step.args[0].dtype, args, types[0], lanes)

    def _arithmetic(self, out, name, dtype, args, kind, lanes) -> None:
        word = OPERATIONS[name].word(dtype)
        if word is None:
            raise NotImplementedError(f"{name} of {dtype}")
        if word.startswith("llvm."):
            full = f"@{word}.{suffix(dtype, lanes)}"
            self.module.declarations.add(f"declare {kind} {full}({', '.join([kind] * len(args))})")
            typed = ", ".join(f"{kind} {arg}" for arg in args)
            self.line(f"{out} = call {kind} {full}({typed})")
        else:
            self.line(f"{out} = {word} {kind} {', '.join(args)}")

    def _any(self, out: str, predicate: Scalar) -> None:
        lanes = self.module.lanes
        bits = self.fresh()
        self.line(f"{bits} = bitcast <{lanes} x i1> {self.operand(predicate)} to i{lanes}")
        self.line(f"{out} = icmp ne i{lanes} {bits}, 0")

    def _convert(self, out: str, x: str, old: np.dtype, new: np.dtype, wide: bool) -> None:
        before, after = self._type(old, wide), self._type(new, wide)
        if old.kind == "f" and new.kind in "iu":
            word = "llvm.fptosi.sat" if new.kind == "i" else "llvm.fptoui.sat"
            lanes = self.module.lanes if wide else None
            full = f"@{word}.{suffix(new, lanes)}.{suffix(old, lanes)}"
            self.module.declarations.add(f"declare {after} {full}({before})")
            self.line(f"{out} = call {after} {full}({before} {x})")
            return
        if old.kind == "f":
            word = "fptrunc" if new.itemsize < old.itemsize else "fpext"
        elif new.kind == "f":
            word = "sitofp" if old.kind == "i" else "uitofp"
        elif old.kind == "b" or new.itemsize > old.itemsize:
            word = "sext" if old.kind == "i" else "zext"
        else:
            word = "trunc" if new.itemsize < old.itemsize else "bitcast"
        self.line(f"{out} = {word} {before} {x} to {after}")

    def _type(self, dtype: np.dtype, wide: bool) -> str:
        return vector_type(dtype, self.module.lanes) if wide else scalar_type(dtype)

    def _call(self, step: Call) -> None:
        name = self.module.add(step.function)
        params = step.function.params
        typed = ", ".join(
            f"{type_of(param, self.module.lanes)} {self.operand(arg, not param.uniform)}"
            for param, arg in zip(params, step.args, strict=True)
        )
        returned = result_type(step.function.results, self.module.lanes)
        if len(step.outs) == 1:
            self.line(f"{self.name(step.outs[0])} = call {returned} {name}({typed})")
            return
        whole = self.fresh()
        self.line(f"{whole} = call {returned} {name}({typed})")
        for number, out in enumerate(step.outs):
            self.line(f"{self.name(out)} = extractvalue {returned} {whole}, {number}")

    def _loop(self, step: Loop) -> None:
        entry, number = self._label, self.fresh("")[1:]
        head, work, out = f"head{number}", f"work{number}", f"out{number}"
        before = [
            self.operand(b, not p.uniform) for b, p in zip(step.before, step.params, strict=True)
        ]
        self.line(f"br label %{head}")
        self._begin(head)
        place = len(self._lines)
        self._spread.append({})
        self.steps(step.condition)
        going = self.operand(step.active)
        if not is_uniform(step.active):
            going = self.fresh()
            self._any(going, step.active)
        self.line(f"br i1 {going}, label %{work}, label %{out}")
        self._begin(work)
        self._spread.append({})
        self.steps(step.body)
        after = [
            self.operand(a, not p.uniform) for a, p in zip(step.after, step.params, strict=True)
        ]
        self._spread[-2:] = []
        last = self._label
        self.line(f"br label %{head}")
        self._lines[place:place] = [
            f"{self.name(p)} = phi {self._type(p.dtype, not p.uniform)} "
            f"[ {b}, %{entry} ], [ {a}, %{last} ]"
            for p, b, a in zip(step.params, before, after, strict=True)
        ]
        self._begin(out)

    def _operands(self, given: Sequence[Scalar], to: Sequence[Value]) -> list[str]:
        return [self.operand(x, not out.uniform) for x, out in zip(given, to, strict=True)]

    def _switch(self, step: Switch) -> None:
        number = self.fresh("")[1:]
        labels = [f"case{number}.{i}" for i in range(len(step.blocks))]
        out, kind = f"out{number}", scalar_type(step.index.dtype)
        targets = " ".join(f"{kind} {i}, label %{label}" for i, label in enumerate(labels[1:], 1))
        index = self.operand(step.index)
        self.line(f"switch {kind} {index}, label %{labels[0]} [ {targets} ]")
        sources = []
        for label, block, results in zip(labels, step.blocks, step.yields, strict=True):
            self._begin(label)
            self._spread.append({})
            self.steps(block)
            found = self._operands(results, step.outs)
            self._spread.pop()
            sources.append((found, self._label))
            self.line(f"br label %{out}")
        self._begin(out)
        for i, value in enumerate(step.outs):
            pairs = ", ".join(f"[ {found[i]}, %{label} ]" for found, label in sources)
            self.line(f"{self.name(value)} = phi {type_of(value, self.module.lanes)} {pairs}")

    def _begin(self, label: str) -> None:
        self.line(f"{label}:")
        self._label = label

    def _memory(self, memory: Memory) -> str:
        if memory.number in self._memories:
            return self._memories[memory.number]
        kind = memory_type(memory.dtype)
        if memory.initial is not None:
            name = f"@c{len(self.module.constants)}"
            numbers = ", ".join(f"{kind} {constant(x) if kind != 'i8' else int(x)}"
                                for x in memory.initial)  # fmt: skip
            head = f"{name} = internal constant [{memory.size} x {kind}]"
            self.module.constants[memory.number] = f"{head} [{numbers}], align 128"
        else:
            room = memory.size * (1 if memory.uniform else self.module.lanes)
            name = f"%m{len(self._memories)}"
            self._first.append(f"{name} = alloca [{room} x {kind}], align 128")
        self._memories[memory.number] = name
        return name

    def _address(self, memory: Memory, index: Scalar) -> str:
        place, kind = self.fresh("p"), memory_type(memory.dtype)
        cell = kind if memory.uniform else f"<{self.module.lanes} x {kind}>"
        typed = f"{scalar_type(index.dtype)} {self.operand(index)}"
        self.line(f"{place} = getelementptr {cell}, ptr {self._memory(memory)}, {typed}")
        return place

    def _store(self, step: Store) -> None:
        wide = not step.memory.uniform
        value = self.operand(step.value, wide)
        self.put(self._address(step.memory, step.index), value, step.memory.dtype, wide)

    def put(self, place: str, value: str, dtype: np.dtype, wide: bool) -> None:
        """Write a value to memory."""
        kind = self._type(dtype, wide)
        if dtype.kind == "b":
            byte, small = self.fresh(), f"<{self.module.lanes} x i8>" if wide else "i8"
            self.line(f"{byte} = zext {kind} {value} to {small}")
            kind, value = small, byte
        self.line(f"store {kind} {value}, ptr {place}")

    def get(self, out: str, place: str, dtype: np.dtype, wide: bool) -> None:
        """Read a value from memory."""
        kind = self._type(dtype, wide)
        if dtype.kind == "b":
            byte, small = self.fresh(), f"<{self.module.lanes} x i8>" if wide else "i8"
            self.line(f"{byte} = load {small}, ptr {place}")
            self.line(f"{out} = icmp ne {small} {byte}, zeroinitializer" if wide
                      else f"{out} = icmp ne i8 {byte}, 0")  # fmt: skip
        else:
            self.line(f"{out} = load {kind}, ptr {place}")

    def _load(self, step: Load) -> None:
        if is_uniform(step.index):
            place = self._address(step.memory, step.index)
            self.get(self.name(step.out), place, step.memory.dtype, not step.memory.uniform)
            return
        self.gather(step)

    def gather(self, step: Load) -> None:
        """Every lane's own element, lane by lane."""
        memory, lanes = step.memory, self.module.lanes
        index, kind = self.operand(step.index), memory_type(memory.dtype)
        wide, base = vector_type(step.index.dtype, lanes), self._memory(memory)
        number, cells, whole = scalar_type(step.index.dtype), f"<{lanes} x {kind}>", "poison"
        for lane in range(lanes):
            i, place, one, more = self.fresh(), self.fresh("p"), self.fresh(), self.fresh()
            self.line(f"{i} = extractelement {wide} {index}, i64 {lane}")
            if memory.uniform:
                self.line(f"{place} = getelementptr {kind}, ptr {base}, {number} {i}")
            else:
                self.line(f"{place} = getelementptr {cells}, ptr {base}, {number} {i}, i64 {lane}")
            self.line(f"{one} = load {kind}, ptr {place}")
            self.line(f"{more} = insertelement {cells} {whole}, {kind} {one}, i64 {lane}")
            whole = more
        out = self.name(step.out)
        if memory.dtype.kind == "b":
            self.line(f"{out} = icmp ne {cells} {whole}, zeroinitializer")
        else:
            self.line(f"{out} = bitcast {cells} {whole} to {cells}")
