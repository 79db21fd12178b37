"""Programs of scalars as C: statements, with expressions put together where they are used.

A value that is needed once goes into the expression that needs it, as long as that fits a line; any
other gets a name, that of the Python variable that it is computed for.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from jaxsat.engine.native.ir import (
    Block,
    Call,
    Load,
    Loop,
    Memory,
    Operation,
    Scalar,
    Source,
    Step,
    Store,
    Switch,
    Value,
    definitions,
)
from jaxsat.engine.native.lowering import CannotLower
from jaxsat.engine.native.trace import Trace
from jaxsat.export.contexts import arrays_in, base_of, squeezed
from jaxsat.export.expressions import (
    UNARY,
    Expression,
    called,
    literal,
    operation,
)
from jaxsat.export.functions import POINTERS, Unit
from jaxsat.export.helpers import TYPES
from jaxsat.export.loops import bound_of
from jaxsat.export.naming import Names, comment
from jaxsat.export.text import WIDTH, braced, dimensions, in_lines
from jaxsat.export.tidying import tidied
from jaxsat.export.wishes import element_of, name_of, wish_of

CONSTANT = ("p", "in", "now")
"""Structures that are only read."""


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
        told: str | None = None,
    ):
        self.unit, self.trace, self.names = unit, trace, names
        self.known = dict(known)
        self.kept = kept or {}
        self.lines: list[str] = []
        self._depth = 1
        self._pending: dict[int, tuple[Expression, Value, int]] = {}
        self._uses: Counter[int] = Counter()
        self._elsewhere: set[int] = set()
        self._own: set[int] = set()
        self._makers: dict[int, Operation] = {}
        self._memories: dict[int, str] = {}
        self._told = self._own_name = told
        self._arrays: dict[tuple[int, int], str] = {}
        self._parts: dict[str, list[str]] = {}
        self._kinds: dict[str, str] = {}
        self._scope = 0
        self._scopes = 0
        self._pointers: set[str] = set()
        self._gathered: dict[tuple[int, str], str] = {}
        self._constant = {one.text.split("[")[0] for one in known.values()}

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
            wish = self.trace.names.get(out.number) or wish_of(frames)
            return self.names.new(wish), True
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
        """The lines, as short as they can be."""
        single = {
            parts[0]: self._kinds[name]
            for name, parts in self._parts.items()
            if len(parts) == 1 and not self._kinds[name].endswith(" ")
        }
        return tidied(self.lines, self._own_name, single)

    def _assign(self, place: str, expression: Expression) -> None:
        text = f"{place} = {expression.text};"
        if len(text) + 2 * self._depth <= 100:
            self.line(text)
            return
        self.line(f"{place} =")
        self.lines += in_lines(f"{expression.text};", "  " * (self._depth + 2))

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
            self._pending[number] = (expression, out, self._scope)
        else:
            self._name(out, expression)

    def _memory(self, memory: Memory) -> str:
        if memory.elements:
            return self._argument(memory.elements, (memory.size,)).text
        if memory.initial is not None:
            return self.unit.memory(memory)
        if memory.number not in self._memories:
            name = self.names.new("array")
            self._memories[memory.number] = name
            self.line(f"{TYPES[memory.dtype]} {name}[{memory.size}];")
        return self._memories[memory.number]

    def _call(self, step: Call) -> None:
        if step.function.source is not None:
            self._python_call(step, step.function.source)
            return
        args = self._operands(step.args)
        name = self.unit.elementary(step.function, self.trace)
        if len(step.outs) == 1:
            self._made(step.outs[0], called(name, *args))
            return
        pointers = []
        for out in step.outs:
            place = self._place(out)
            pointers.append(Expression(f"&{place}"))
        self.line(f"{called(name, *args, *pointers).text};")

    def _python_call(self, step: Call, source: Source) -> None:
        """A call of a function that takes arrays and gives some."""
        printed = self.unit.python(step.function, self.trace)
        self._pointers.update(printed.pointers)
        args = [Expression(text) for text in (*printed.pointers, *printed.counts)]
        arrays = arrays_in(step.args, source.params)
        for array, shape, passed in zip(arrays, source.params, printed.passed, strict=True):
            if passed:
                args.append(self._argument(array, squeezed(shape)))
        returned, after = None, []
        outs = arrays_in(step.outs, source.results)
        for array, shape, way in zip(outs, source.results, printed.results, strict=True):
            if way == "value":
                returned = array[0]
            elif way == "pointer":
                args.append(self._receiver(array, squeezed(shape), after))
            else:
                for out in array:
                    self.known[out.number] = Expression(self.kept[out.number])
        call = called(printed.name, *args)
        if returned is not None and "field" not in printed.results:
            self._made(returned, call)
        elif returned is not None:
            self._name(returned, call)
        else:
            for line in in_lines(f"{call.text};", "  " * self._depth):
                self.lines.append(line)
        for place, text in after:
            self.line(f"{place} = {text};")

    def _argument(self, array: Sequence[Scalar], shape: tuple[int, ...]) -> Expression:
        """A number, or an array of C with these elements."""
        if not shape:
            return self._operands(array)[0]
        if not any(isinstance(x, Value) for x in array):
            return Expression(self.unit.table(array, shape, "constant"))  # pyright: ignore
        self._complete(array, shape)
        texts = [
            self.known[x.number].text if isinstance(x, Value) and x.number in self.known else None
            for x in array
        ]
        base = base_of(texts, shape)
        if base is None:
            texts = [self.operand(x).text for x in array]
            numbers = braced(texts, shape)
            key = (self._scope, numbers)
            if key in self._gathered:
                return Expression(self._gathered[key])
            base = self._gathered[key] = self.names.new(name_of(self.trace, array[0], "given"))
            kind = TYPES[array[0].dtype]
            text = f"const {kind} {base}{dimensions(shape)} = {numbers};"
            self.lines += in_lines(text, "  " * self._depth)
            return Expression(base)
        begin = re.split(r"\W", base)[0]
        if len(shape) > 1 and begin not in CONSTANT and begin not in self._constant:
            kind = TYPES[array[0].dtype]
            return Expression(f"(const {kind} (*){dimensions(shape[1:])}){base}", UNARY)
        return Expression(base)

    def _complete(self, array: Sequence[Scalar], shape: tuple[int, ...]) -> None:
        """Put what is no element of an array of C yet, but should be, into one."""
        elements = [element_of(self.trace, x) if isinstance(x, Value) else None for x in array]
        first = elements[0]
        if first is None:
            return
        row = first.index[: len(first.index) - len(shape)]
        wanted = [(first.array, (*row, *index)) for index in np.ndindex(shape)]
        if wanted != [e and (e.array, e.index) for e in elements]:
            return
        if first.shape[len(row) :] != shape:
            return
        waiting = {}
        for number, (_, value, scope) in self._pending.items():
            element = element_of(self.trace, value) if scope == self._scope else None
            if element is not None and element.array == first.array:
                waiting[number] = value
        for number, value in waiting.items():
            self._name(value, self._pending.pop(number)[0])

    def _receiver(
        self, array: Sequence[Value], shape: tuple[int, ...], after: list[tuple[str, str]]
    ) -> Expression:
        """Where a function writes an array of results; `after` it some are copied elsewhere."""
        if not shape:
            return Expression(f"&{self._place(array[0])}".replace("&*", ""))
        texts = [self.kept.get(out.number) for out in array]
        base = base_of(texts, shape)
        if base is None:
            base = self.names.new(name_of(self.trace, array[0], "result"))
            self.line(f"{TYPES[array[0].dtype]} {base}{dimensions(shape)};")
        for index, out, text in zip(np.ndindex(shape), array, texts, strict=True):
            place = base + "".join(f"[{i}]" for i in index)
            self.known[out.number] = Expression(place)
            if text is not None and text != place:
                after.append((text, place))
                self.known[out.number] = Expression(text)
        return Expression(base)

    def pointers(self, lines: Sequence[str]) -> set[str]:
        """Which structures these lines of the function need."""
        text = "\n".join(lines)
        read = {one for one in POINTERS if re.search(rf"(?<![\w>.]){one}(->|\[)", text)}
        return read | self._pointers

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
                    case Load(memory=memory) | Store(memory=memory) if not memory.elements:
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
        bound = bound_of(step, self._makers)
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
        case Load(index=index, memory=memory):
            return [index, *memory.elements]
        case Store(index=index, value=value):
            return [index, value]
        case Switch(index=index):
            return [index]
        case Loop(before=before):
            return list(before)
