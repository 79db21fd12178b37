"""Programs of scalars as C: statements, with expressions put together where they are used.

A value that is needed once goes into the expression that needs it, as long as that fits a line; any
other gets a name, that of the Python variable that it is computed for.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from jaxsat.engine.native.builder import Element, Frame, Trace
from jaxsat.engine.native.ir import (
    Block,
    Call,
    Function,
    Load,
    Loop,
    Memory,
    Operation,
    Scalar,
    Step,
    Store,
    Switch,
    Value,
    definitions,
)
from jaxsat.engine.native.lowering import CannotLower
from jaxsat.export.expressions import (
    UNARY,
    Expression,
    called,
    literal,
    operation,
)
from jaxsat.export.helpers import TYPES, helper
from jaxsat.export.naming import Names, assigned_name, comment, identifier
from jaxsat.export.rolling import rolled

WIDTH = 92
"""Characters of an expression in a line."""

LIBM = frozenset((
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf",
    "erfc", "exp", "exp2", "expm1", "log", "log1p", "pow", "sin", "sinh", "tan", "tanh"
))  # fmt: skip
"""Elementary functions that the C library may be taken for."""


def element_of(trace: Trace, value: Value) -> Element | None:
    """The array's element that a value is, if it was computed by the statement that made that."""
    found, places = trace.elements.get(value.number), trace.places.get(value.number, ())
    if found is None or not places or not found.place:
        return None
    here, there = places[-1], found.place[-1]
    same = here.function == there.function and here.file == there.file
    if same and assigned_name(here.file, here.line) == assigned_name(there.file, there.line):
        return found
    return None


def wish_of(frames: tuple[Frame, ...]) -> str:
    """The name that Python has for what is computed at a place."""
    for frame in reversed(frames):
        name = assigned_name(frame.file, frame.line) or frame.function.split(".")[-1]
        if not name.startswith("<"):
            return identifier(name)
    return "x"


class Unit:
    """A C file while it is printed: the static functions and tables that its programs need."""

    def __init__(self, libm: bool, taken: Iterable[str] = ()):
        self.libm = libm
        self.names = Names(taken)
        self.helpers: dict[str, str] = {}
        self.tables: list[str] = []
        self.functions: list[list[str]] = []
        self._printed: dict[int, str] = {}
        self._tables: dict[int, str] = {}

    def need(self, name: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """The name of a helper, which is printed once."""
        full, text, needs = helper(name, dtype, other)
        if full not in self.helpers:
            for one in needs:
                self.need(*one)
            self.names.new(full)
            self.helpers[full] = text
        return full

    def table(self, memory: Memory, wish: str) -> str:
        """The name of an array of constants."""
        if memory.number not in self._tables:
            assert memory.initial is not None
            name = self.names.new(f"{wish}_table")
            numbers = ", ".join(literal(x).text for x in memory.initial)
            head = f"static const {TYPES[memory.dtype]} {name}[{memory.size}] = {{"
            self.tables.append("\n".join([head, *wrapped(numbers), "};"]))
            self._tables[memory.number] = name
        return self._tables[memory.number]

    def function(self, function: Function, trace: Trace) -> str:
        """The name of a function that programs call, printed once for equal ones."""
        word = function.name.split(".")[0]
        if self.libm and word in LIBM:
            return word + ("f" if function.results[0].dtype.itemsize == 4 else "")
        if id(function) not in self._printed:
            name = self.names.new(identifier(f"{word}_of" if word in LIBM else word))
            self._printed[id(function)] = name
            self.functions.append(_function_text(self, name, function, trace))
        return self._printed[id(function)]


def wrapped(text: str) -> list[str]:
    """Words in lines."""
    lines, line = [], " "
    for word in text.split(" "):
        if len(line) + len(word) > WIDTH:
            lines.append(line)
            line = " "
        line += f" {word}"
    return [*lines, line]


def _function_text(unit: Unit, name: str, function: Function, trace: Trace) -> list[str]:
    names = Names(unit.names._taken)
    params = {p.number: Expression(names.new("xyzuvw"[i] if i < 6 else f"x_{i}"))
              for i, p in enumerate(function.params)}  # fmt: skip
    body = Printer(unit, trace, params, names)
    body.count(function.block, function.results)
    body.block(function.block)
    given = [f"{TYPES[p.dtype]} {params[p.number].text}" for p in function.params]
    if len(function.results) == 1:
        body.line(f"return {body.operand(function.results[0]).text};")
        head = f"static {TYPES[function.results[0].dtype]} {name}({', '.join(given)})"
    else:
        for i, result in enumerate(function.results):
            given.append(f"{TYPES[result.dtype]} *out_{i + 1}")
            body.line(f"*out_{i + 1} = {body.operand(result).text};")
        head = f"static void {name}({', '.join(given)})"
    return [head, "{", *body.text(), "}"]


class Printer:
    """Statements of one C function.

    `known` are expressions for values from outside, and `kept` the places (lvalues) of those that
    others read later.
    """

    def __init__(
        self,
        unit: Unit,
        trace: Trace,
        known: Mapping[int, Expression],
        names: Names,
        kept: Mapping[int, str] | None = None,
    ):
        self.unit, self.trace, self.names = unit, trace, names
        self.known = dict(known)
        self.kept = kept or {}
        self.lines: list[str] = []
        self._depth = 1
        self._pending: dict[int, tuple[Expression, np.dtype]] = {}
        self._uses: Counter[int] = Counter()
        self._elsewhere: set[int] = set()
        self._own: set[int] = set()
        self._makers: dict[int, Operation] = {}
        self._memories: dict[int, str] = {}
        self._told: str | None = None
        self._arrays: dict[tuple[int, int], str] = {}
        self._parts: dict[str, list[str]] = {}
        self._kinds: dict[str, str] = {}
        self._scope = 0
        self._scopes = 0

    def line(self, text: str) -> None:
        """One more."""
        self.lines.append("  " * self._depth + text)

    def count(self, block: Block, results: Iterable[Scalar], own: set[int] | None = None) -> None:
        """Look at how often values are used, and where; before anything of a block is printed."""
        own = set() if own is None else own
        self.count_steps(block.steps, own=own)
        for scalar in results:
            self._use(scalar, own)

    def count_results(self, results: Iterable[Value]) -> None:
        """Values that are read once all is done."""
        for value in results:
            self._use(value, set())

    def count_steps(
        self, steps: Sequence[Step], *, here: bool = True, own: set[int] | None = None
    ) -> None:
        """The same of steps that are printed `here`, in one block, or by another printer."""
        own = self._own if own is None else own
        for step in steps:
            if isinstance(step, Operation):
                self._makers[step.out.number] = step
            for scalar in _read(step):
                self._use(scalar, own if here else set())
            match step:
                case Switch():
                    for inside, yields in zip(step.blocks, step.yields, strict=True):
                        self.count(inside, yields)
                case Loop():
                    self.count(step.condition, [step.active])
                    self.count(step.body, step.after)
                case _:
                    pass
            if here:
                own.update(out.number for out in definitions(step))

    def _use(self, scalar: Scalar, own: set[int]) -> None:
        if isinstance(scalar, Value):
            self._uses[scalar.number] += 1
            if scalar.number not in own:
                self._elsewhere.add(scalar.number)

    def block(self, block: Block) -> None:
        """The statements of a block."""
        for step in block.steps:
            self.step(step)

    def step(self, step: Step) -> None:
        """The statements of one step."""
        match step:
            case Operation():
                self._operation(step)
            case Load():
                index = self.operand(step.index)
                self._name(step.out, Expression(f"{self._memory(step.memory)}[{index.text}]"))
            case Store():
                index, value = self.operand(step.index), self.operand(step.value)
                self.line(f"{self._memory(step.memory)}[{index.text}] = {value.text};")
            case Switch():
                self._switch(step)
            case Loop():
                self._loop(step)
            case Call():
                self._call(step)

    def operand(self, x: Scalar) -> Expression:
        """A value or constant as an expression."""
        if not isinstance(x, Value):
            return literal(x)
        if x.number in self._pending:
            return self._pending.pop(x.number)[0]
        return self.known[x.number]

    def _operands(self, scalars: Sequence[Scalar]) -> list[Expression]:
        """Several; the longest are given names where they would not fit a line together."""
        waiting = {x.number: x for x in scalars if isinstance(x, Value)}
        while True:
            there = [n for n in waiting if n in self._pending]
            size = sum(len(self._pending[n][0].text) for n in there)
            if size + 14 * (len(scalars) - len(there)) <= WIDTH or not there:
                break
            longest = max(there, key=lambda n: len(self._pending[n][0].text))
            if len(self._pending[longest][0].text) < 16:
                break
            self._name(waiting[longest], self._pending.pop(longest)[0])
        return [self.operand(x) for x in scalars]

    def _name(self, out: Value, expression: Expression) -> None:
        """A name for a value: a local constant, or its place if others read it later."""
        self._tell(out)
        place = self.kept.get(out.number)
        if place is not None:
            self._assign(place, expression)
            self.known[out.number] = Expression(place)
            return
        name, begin = self._local(out)
        self._assign(f"const {TYPES[out.dtype]} {name}" if begin else name, expression)
        self.known[out.number] = Expression(name)

    def _local(self, out: Value) -> tuple[str, bool]:
        """A variable of this function for a value, and whether it is still to be declared."""
        frames = self.trace.places.get(out.number, ())
        element = element_of(self.trace, out)
        if element is None:
            return self.names.new(wish_of(frames)), True
        key = (element.array, self._scope)
        if key not in self._arrays:
            name = self.names.new(wish_of(element.place))
            dims = "".join(f"[{n}]" for n in element.shape)
            self._arrays[key] = name
            self._parts[name] = []
            self._kinds[name] = TYPES[out.dtype]
            self.line(f"{TYPES[out.dtype]} {name}{dims};")
        name = self._arrays[key]
        part = name + "".join(f"[{i}]" for i in element.index)
        self._parts[name].append(part)
        return part, False

    def text(self) -> list[str]:
        """The lines; arrays of which one element is used are no arrays, repetitions are loops."""
        lines = "\n".join(self.lines)
        for name, parts in self._parts.items():
            if len(parts) == 1 and not self._kinds[name].endswith(" "):
                lines = re.sub(rf"\n *\w+ {name}(\[\d+\])+;(?=\n)", "", f"\n{lines}")[1:]
                kind = self._kinds[name]
                part = re.escape(parts[0])
                lines = re.sub(
                    rf"(^|\n)( *){part} =", rf"\1\2const {kind} {name} =", lines, count=1
                )
                lines = re.sub(rf"(?<![\w>.]){part}", name, lines)
        return rolled(lines.split("\n")) if lines else []

    def _assign(self, place: str, expression: Expression) -> None:
        text = f"{place} = {expression.text};"
        if len(text) + 2 * self._depth <= 100:
            self.line(text)
            return
        self.line(f"{place} =")
        self._depth += 2
        self.line(f"{expression.text};")
        self._depth -= 2

    def _tell(self, out: Value) -> None:
        """A comment where another function of the source begins."""
        frames = self.trace.places.get(out.number, ())
        if frames and frames[-1].function != self._told:
            self._told = frames[-1].function
            for line in comment(self._told):
                self.line(line)

    def _operation(self, step: Operation) -> None:
        args = self._operands(step.args)
        kinds = [x.dtype for x in step.args]
        expression = operation(step.name, args, kinds, step.out.dtype, self.unit.need)
        self._made(step.out, expression)

    def _made(self, out: Value, expression: Expression) -> None:
        """Keep an expression for the one who needs it, or give it a name."""
        number = out.number
        once = self._uses[number] == 1 and number not in self._elsewhere
        if once and number not in self.kept and len(expression.text) <= WIDTH:
            self._pending[number] = (expression, out.dtype)
        else:
            self._name(out, expression)

    def _memory(self, memory: Memory) -> str:
        if memory.initial is not None:
            return self.unit.table(memory, "constant")
        if memory.number not in self._memories:
            name = self.names.new("array")
            self._memories[memory.number] = name
            self.line(f"{TYPES[memory.dtype]} {name}[{memory.size}];")
        return self._memories[memory.number]

    def _call(self, step: Call) -> None:
        args = self._operands(step.args)
        name = self.unit.function(step.function, self.trace)
        if len(step.outs) == 1:
            self._made(step.outs[0], called(name, *args))
            return
        pointers = []
        for out in step.outs:
            place = self._place(out)
            pointers.append(Expression(f"&{place}"))
        self.line(f"{called(name, *args, *pointers).text};")

    def _place(self, out: Value, first: str | None = None) -> str:
        """A variable for a value that is assigned further on."""
        place = self.kept.get(out.number)
        if place is None:
            place, undeclared = self._local(out)
            begin = "" if first is None else f" = {first}"
            if undeclared:
                self.line(f"{TYPES[out.dtype]} {place}{begin};")
            elif first is not None:
                self.line(f"{place} = {first};")
            else:
                self._kinds[place.split("[")[0]] += " "  # assigned in several places
        elif first is not None:
            self.line(f"{place} = {first};")
        self.known[out.number] = Expression(place)
        return place

    def _declare_memories(self, blocks: Iterable[Block]) -> None:
        """Arrays that blocks inside use are there before them."""
        for block in blocks:
            for step in block.steps:
                match step:
                    case Load(memory=memory) | Store(memory=memory):
                        self._memory(memory)
                    case Switch(blocks=inside):
                        self._declare_memories(inside)
                    case Loop(condition=condition, body=body):
                        self._declare_memories((condition, body))
                    case _:
                        pass

    def _switch(self, step: Switch) -> None:
        self._declare_memories(step.blocks)
        condition = self._condition(step.index) if len(step.blocks) == 2 else None
        index = self.operand(step.index) if condition is None else None
        if step.outs:
            self._tell(step.outs[0])
        places = [self._place(out) for out in step.outs]
        if len(step.blocks) == 2:
            if condition is None:
                assert index is not None
                condition = f"{index.inside(UNARY)} != 0"
            self.line(f"if ({condition}) {{")
            self._branch(step, 1, places)
            self.line("} else {")
            self._branch(step, 0, places)
            self.line("}")
            return
        assert index is not None
        self.line(f"switch ({index.text}) {{")
        for number in range(len(step.blocks)):
            last = number == len(step.blocks) - 1
            self.line("default: {" if last else f"case {number}: {{")
            self._branch(step, number, places)
            self.line("  break;")
            self.line("}")
        self.line("}")

    def _branch(self, step: Switch, number: int, places: Sequence[str]) -> None:
        self._depth += 1
        outer, self._scope = self._scope, self._new_scope()
        told, self._told = self._told, None
        self.block(step.blocks[number])
        for place, result in zip(places, step.yields[number], strict=True):
            self._assign(place, self.operand(result))
        self._told, self._scope = told, outer
        self._depth -= 1

    def _new_scope(self) -> int:
        self._scopes += 1
        return self._scopes

    def _condition(self, index: Scalar) -> str | None:
        """The bool that a branch of two is chosen by, behind the steps that make a number of it."""
        while isinstance(index, Value) and index.number in self._makers:
            maker = self._makers[index.number]
            one = maker.args[0]
            others = [x for x in maker.args if not isinstance(x, Value)]
            if maker.name == "convert" and one.dtype == np.dtype(bool):
                found = self.operand(index) if index.number in self._pending else None
                if found is not None and one.number in self.known:  # pyright: ignore
                    return self.known[one.number].text  # pyright: ignore
                if found is not None and found.text.endswith(" ? 1 : 0"):
                    text = found.text.removesuffix(" ? 1 : 0")
                    return text[1:-1] if _is_enclosed(text) else text
                return None
            within = {"max": lambda x: x <= 0, "min": lambda x: x >= 1}.get(maker.name)
            if within is None or len(others) != 1 or not within(int(others[0])):
                return None
            inner = next(x for x in maker.args if isinstance(x, Value))
            if index.number in self._pending and inner.number not in self.known:
                return None
            index = inner
        return None

    def _loop(self, step: Loop) -> None:
        bound = _bound(step, self._makers)
        if bound is None:
            frames = self.trace.places.get(step.params[0].number, ()) if step.params else ()
            where = f"{frames[-1].file}:{frames[-1].line} ({frames[-1].function})" if frames else ""
            what = "`while`: how often the loop turns is not known when the law is traced"
            raise CannotLower(f"{what}, so that flight code has no bound for it", where)
        counter, first, last, whole = bound
        self._declare_memories((step.condition, step.body))
        self._tell(step.params[0])
        befores = [self.operand(x).text for x in step.before]
        for i, (param, before) in enumerate(zip(step.params, befores, strict=True)):
            if i != counter:
                self._place(param, before)
        name = self._place(step.params[counter], befores[counter])
        del first
        self.line(f"for (; {name} < {last}; {name}++) {{")
        self._depth += 1
        outer, self._scope = self._scope, self._new_scope()
        told, self._told = self._told, None
        if not whole:
            self.block(step.condition)
            self.line(f"if (!{self.operand(step.active).inside(UNARY)}) {{")
            self.line("  break;")
            self.line("}")
        else:
            for one in step.condition.steps:
                self.step(one)
        self.block(step.body)
        self._carry_over(step, counter)
        self._told, self._scope = told, outer
        self._depth -= 1
        self.line("}")

    def _carry_over(self, step: Loop, counter: int) -> None:
        """The params of the next turn, all computed before the first is assigned."""
        moves = []
        params = {param.number for param in step.params}
        for i, (param, after) in enumerate(zip(step.params, step.after, strict=True)):
            if i == counter:
                self._pending.pop(getattr(after, "number", -1), None)
                continue
            if isinstance(after, Value) and after.number == param.number:
                continue
            pending = isinstance(after, Value) and after.number in self._pending
            if pending or (isinstance(after, Value) and after.number in params):
                name = self.names.new("following")
                self._assign(f"const {TYPES[after.dtype]} {name}", self.operand(after))
                moves.append((param, name))
            else:
                moves.append((param, self.operand(after).text))
        for param, text in moves:
            self.line(f"{self.known[param.number].text} = {text};")


def _is_enclosed(text: str) -> bool:
    """Whether the first parenthesis of a text ends with it."""
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return letter == ")" and place == len(text) - 1
    return False


def _read(step: Step) -> list[Scalar]:
    """The scalars that a step itself reads, without those of its blocks."""
    match step:
        case Operation(args=args) | Call(args=args):
            return list(args)
        case Load(index=index):
            return [index]
        case Store(index=index, value=value):
            return [index, value]
        case Switch(index=index):
            return [index]
        case Loop(before=before):
            return list(before)


def _bound(step: Loop, makers: Mapping[int, Operation]) -> tuple[int, int, int, bool] | None:
    """Of a loop that counts up to a constant: which param counts, from where, to where, and whether
    that is its whole condition."""
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
                return i, int(before), int(maker.args[1]), whole  # pyright: ignore
    return None


def _conjuncts(active: Scalar, makers: Mapping[int, Operation]) -> list[int]:
    """Numbers of the conditions that must all hold."""
    if not isinstance(active, Value):
        return []
    maker = makers.get(active.number)
    if maker is not None and maker.name == "and":
        return [number for arg in maker.args for number in _conjuncts(arg, makers)]
    return [active.number]
