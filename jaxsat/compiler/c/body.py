"""Body of a C function: its lines, and the expressions of its values.

A value that is used once is inlined as long as that fits a line; any other gets a name, that of the
Python variable for which it is computed. `Uses` counts.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from jaxsat.compiler import ir
from jaxsat.compiler.c.expressions import Expression, literal
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.naming import Names, comment, element_of, wish_of
from jaxsat.compiler.c.tidying import WIDTH, in_lines, tidied
from jaxsat.compiler.trace import Trace

LINE = 100
"""Largest number of characters in a line."""


class Uses:
    """Uses of every value of a block, with those in inner blocks.

    `makers` are the operations that define values, by the value's number.
    """

    def __init__(self, block: ir.Block, results: Iterable[ir.Scalar]):
        self.makers: dict[int, ir.Operation] = {}
        self._count: Counter[int] = Counter()
        self._elsewhere: set[int] = set()
        self._block(block, results)

    def is_once(self, value: ir.Value) -> bool:
        """Whether a value is used once, in the block that defines it."""
        return self._count[value.number] == 1 and value.number not in self._elsewhere

    def _block(self, block: ir.Block, results: Iterable[ir.Scalar]) -> None:
        local_values: set[int] = set()
        for step in block.steps:
            if isinstance(step, ir.Operation):
                self.makers[step.out.number] = step
            self._read(_read_by(step), local_values)
            match step:
                case ir.BlockSwitch():
                    for inside, yields in zip(step.blocks, step.yields, strict=True):
                        self._block(inside, yields)
                case ir.Loop():
                    self._block(step.condition, [step.active])
                    self._block(step.body, step.after)
                case _:
                    pass
            local_values.update(out.number for out in ir.definitions(step))
        self._read(results, local_values)

    def _read(self, scalars: Iterable[ir.Scalar], local_values: set[int]) -> None:
        for scalar in scalars:
            if isinstance(scalar, ir.Value):
                self._count[scalar.number] += 1
                if scalar.number not in local_values:
                    self._elsewhere.add(scalar.number)


def _read_by(step: ir.Step) -> Sequence[ir.Scalar]:
    """Return the scalars that a step itself reads, without its blocks."""
    match step:
        case ir.Operation(args=args) | ir.Call(args=args):
            return args
        case ir.Load(index=index, memory=memory):
            return [index, *memory.elements]
        case ir.Store(index=index, value=value):
            return [index, value]
        case ir.BlockSwitch(index=index):
            return [index]
        case ir.Loop(before=before):
            return before


class Body:
    """Lines of one C function during printing.

    `expressions` are those of values, at first of external ones, and `places` (lvalues) those of
    values that others read later. `scope` is the number of the current block, `shapes` are those of
    all arrays by name, at first of external ones.
    """

    def __init__(
        self,
        trace: Trace,
        function: ir.Function,
        names: Names,
        expressions: Mapping[int, Expression],
        places: Mapping[int, str] | None = None,
        function_name: str | None = None,
        shapes: Mapping[str, tuple[int, ...]] | None = None,
    ):
        self.trace, self.names = trace, names
        self.uses = Uses(function.block, function.results)
        self.expressions = dict(expressions)
        self.places = places or {}
        self.lines: list[str] = []
        self.scope = 0
        self.shapes = dict(shapes or {})
        self._scopes = 0
        self._depth = 1
        self._pending: dict[int, tuple[Expression, ir.Value, int]] = {}
        self._section = self._own_name = function_name
        self._arrays: dict[tuple[int, int], str] = {}
        self._parts: dict[str, list[str]] = {}
        self._kinds: dict[str, str] = {}

    def line(self, text: str) -> None:
        """Add a line."""
        self.lines.append("  " * self._depth + text)

    def wrapped(self, text: str) -> None:
        """Add a statement, wrapped to as many lines as it needs."""
        self.lines += in_lines(text, "  " * self._depth)

    def assign(self, place: str, expression: Expression) -> None:
        """Add a statement that sets a place to an expression."""
        text = f"{place} = {expression.text};"
        if len(text) + 2 * self._depth <= LINE:
            self.line(text)
            return
        self.line(f"{place} =")
        self.lines += in_lines(f"{expression.text};", "  " * (self._depth + 2))

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Within this context, lines belong to an inner block."""
        outer = self.scope, self._section
        self._depth += 1
        self._scopes += 1
        self.scope, self._section = self._scopes, None
        yield
        self.scope, self._section = outer
        self._depth -= 1

    def tell(self, out: ir.Value) -> None:
        """Add a comment where another function of the source begins."""
        frames = self.trace.places.get(out.number, ())
        if frames and frames[-1].function != self._section:
            self._section = frames[-1].function
            for line in comment(self._section):
                self.line(line)

    def text(self) -> list[str]:
        """Return the lines, tidied, before arrays get initialisers."""
        single = {
            parts[0]: self._kinds[name]
            for name, parts in self._parts.items()
            if len(parts) == 1 and not self._kinds[name].endswith(" ")
        }
        return tidied(self.lines, self._own_name, single)

    def operand(self, x: ir.Scalar) -> Expression:
        """Return a value or constant as an expression."""
        if not isinstance(x, ir.Value):
            return literal(x)
        if x.number in self._pending:
            return self._pending.pop(x.number)[0]
        return self.expressions[x.number]

    def operands(self, scalars: Sequence[ir.Scalar]) -> list[Expression]:
        """Return scalars as expressions; the longest get names if all do not fit a line."""
        waiting = {x.number: x for x in scalars if isinstance(x, ir.Value)}
        while True:
            pending = [n for n in waiting if n in self._pending]
            size = sum(len(self._pending[n][0].text) for n in pending)
            if size + 14 * (len(scalars) - len(pending)) <= WIDTH or not pending:
                break
            longest = max(pending, key=lambda n: len(self._pending[n][0].text))
            if len(self._pending[longest][0].text) < 16:
                break
            self.name(waiting[longest], self._pending.pop(longest)[0])
        return [self.operand(x) for x in scalars]

    def is_pending(self, value: ir.Value) -> bool:
        """Whether the expression of a value waits for its use."""
        return value.number in self._pending

    def drop(self, x: ir.Scalar) -> None:
        """Forget an unused pending value."""
        if isinstance(x, ir.Value):
            self._pending.pop(x.number, None)

    def name_pending(self, is_wanted: Callable[[ir.Value], bool]) -> None:
        """Give names to the pending values of this block that are wanted."""
        waiting = [value for _, value, scope in self._pending.values() if scope == self.scope]
        for value in waiting:
            if is_wanted(value):
                self.name(value, self._pending.pop(value.number)[0])

    def keep(self, out: ir.Value, expression: Expression) -> None:
        """Keep an expression for its use, or give it a name."""
        fits = len(expression.text) <= WIDTH
        if fits and self.uses.is_once(out) and out.number not in self.places:
            self._pending[out.number] = (expression, out, self.scope)
        else:
            self.name(out, expression)

    def name(self, out: ir.Value, expression: Expression) -> None:
        """Give a value a name: a local constant, or its place if others read it later."""
        self.tell(out)
        place = self.places.get(out.number)
        if place is None:
            place, begin = self._local(out)
            self.assign(f"const {TYPES[out.dtype]} {place}" if begin else place, expression)
        else:
            self.assign(place, expression)
        self.expressions[out.number] = Expression(place)

    def place(self, out: ir.Value, first: str | None = None) -> str:
        """Return the variable of a value that is assigned later."""
        place, undeclared = self.places.get(out.number), False
        if place is None:
            place, undeclared = self._local(out)
            if not undeclared and first is None:
                self._kinds[place.split("[")[0]] += " "  # assigned in several places
        if undeclared:
            self.line(f"{TYPES[out.dtype]} {place}{'' if first is None else f' = {first}'};")
        elif first is not None:
            self.line(f"{place} = {first};")
        self.expressions[out.number] = Expression(place)
        return place

    def _local(self, out: ir.Value) -> tuple[str, bool]:
        """Return a local variable for a value, and whether it is still to be declared."""
        frames = self.trace.places.get(out.number, ())
        element = element_of(self.trace, out)
        if element is None:
            wish = self.trace.names.get(out.number) or wish_of(frames)
            return self.names.new(wish), True
        key = (element.array, self.scope)
        if key not in self._arrays:
            name = self.names.new(wish_of(element.place))
            dims = "".join(f"[{n}]" for n in element.shape)
            self._arrays[key] = name
            self.shapes[name] = element.shape
            self._parts[name] = []
            self._kinds[name] = TYPES[out.dtype]
            self.line(f"{TYPES[out.dtype]} {name}{dims};")
        name = self._arrays[key]
        part = name + "".join(f"[{i}]" for i in element.index)
        self._parts[name].append(part)
        return part, False
