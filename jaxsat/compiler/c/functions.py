"""Functions of C: those of the programs' Python code, elementary ones, and tables of constants."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from jaxsat.compiler.c.contexts import Context, arrays_in, contexts, squeezed
from jaxsat.compiler.c.expressions import Expression, literal
from jaxsat.compiler.c.helpers import TYPES, count_of, helper, loop_text
from jaxsat.compiler.c.naming import Names, comment, docstring, identifier, name_of
from jaxsat.compiler.c.printer import Printer
from jaxsat.compiler.c.tidying import braced, dimensions, in_lines
from jaxsat.compiler.c.unit import POINTERS, AbstractUnit, CallSignature
from jaxsat.compiler.ir import Function, Memory, Scalar, Value
from jaxsat.compiler.trace import Trace

LIBM = frozenset((
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf",
    "erfc", "exp", "exp2", "expm1", "log", "log1p", "pow", "sin", "sinh", "tan", "tanh"
))  # fmt: skip
"""Elementary functions that the C library may be taken for."""


class Unit(AbstractUnit):
    """A C file while it is printed: the static functions and tables that its programs need.

    `of_numbers` are the elementary functions of floats alone, by their names; `contexts` are those
    of the functions of the stage that is printed; `types` of the pointers to
    structures, and `shapes` of the arrays there.
    """

    def __init__(self, libm: bool, types: dict[str, str], shapes: dict[str, tuple[int, ...]]):
        self.libm, self.types, self.shapes = libm, types, shapes
        self.names = Names(types)
        self.helpers: dict[str, str] = {}
        self.tables: dict[str, str] = {}
        self.functions: list[list[str]] = []
        self.of_numbers: dict[str, Function] = {}
        self.contexts: dict[int, Context] = {}
        self._reserved: dict[str, str] = {}
        self._printed: dict[int, CallSignature] = {}
        self._alike: dict[str, str] = {}
        self._tables: dict[tuple, str] = {}

    def scope(self) -> Names:
        """The names of a function: none that the file has."""
        return Names(self.types, outer=self.names)

    def need(self, name: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """The name of a helper, which is printed once."""
        full, text, needs = helper(name, dtype, other)
        if full not in self.helpers:
            for one in needs:
                self.need(*one)
            self.helpers[full] = text
        return full

    def used(self, text: str) -> list[str]:
        """The tables and helpers that the text of the functions names, and those that these name.

        A statement that was left out as dead may have been the only one to name them.
        """
        words = set(re.findall(r"\w+", text))
        helpers: list[str] = []
        for name, definition in reversed(self.helpers.items()):
            if name in words:
                words.update(re.findall(r"\w+", definition))
                helpers = [definition, "", *helpers]
        tables = [definition for name, definition in self.tables.items() if name in words]
        return [*tables, "", *helpers] if tables else helpers

    def memory(self, memory: Memory) -> str:
        """The name of an array of constants that is indexed."""
        assert memory.initial is not None
        return self.table(list(memory.initial), (memory.size,), "constant")

    def table(self, numbers: Sequence[np.generic], shape: tuple[int, ...], wish: str) -> str:
        """The name of an array of constants; equal ones are one."""
        kind = TYPES[numbers[0].dtype]
        text = braced([literal(x).text for x in numbers], shape)
        key = (kind, shape, text)
        if key not in self._tables:
            name = self._tables[key] = self.names.new(f"{wish}_table")
            head = f"static const {kind} {name}{dimensions(shape)} = "
            self.tables[name] = "\n".join(in_lines(f"{head}{text};", ""))
        return self._tables[key]

    def elementary(self, function: Function, trace: Trace) -> str:
        """The name of an elementary function of numbers."""
        word = function.name.split(".")[0]
        if self.libm and word in LIBM:
            return word + ("f" if function.results[0].dtype.itemsize == 4 else "")
        if id(function) not in self._printed:
            name = self.names.new(identifier(f"{word}_of" if word in LIBM else word))
            self._printed[id(function)] = CallSignature(name, (), (), ())
            self.functions.append(_elementary_text(self, name, function, trace))
            if {one.dtype.kind for one in (*function.params, *function.results)} == {"f"}:
                self.of_numbers[name] = function
        return self._printed[id(function)].name

    def python(self, function: Function, trace: Trace) -> CallSignature:
        """A function of the Python code, printed once."""
        if id(function) not in self._printed:
            self._printed[id(function)] = self._python(function, trace)
        return self._printed[id(function)]

    def prepare(self, begin: Context, trace: Trace) -> None:
        """Print all that a function calls, and what that calls, before it."""
        by_identity = contexts(begin, trace)
        self.contexts |= by_identity
        functions = [context.function for context in by_identity.values() if context is not begin]
        for function in functions:
            if function.source is None or function.source.loop:
                continue
            word = identifier(_word(function))
            if word not in self._reserved:
                self._reserved[word] = self.names.new(word)
        for function in functions[::-1]:
            self.python(function, trace)

    def _loop(self, function: Function) -> CallSignature:
        """An operation on arrays, printed once for all of one kind."""
        name, lines = loop_text(function)
        key = lines[0]
        if key not in self._alike:
            self._alike[key] = self.names.new(name)
            lines[0] = lines[0].replace(f" {name}(", f" {self._alike[key]}(")
            self.functions.append([*in_lines(lines[0], ""), *lines[1:]])
        source = function.source
        assert source is not None
        ways = ["pointer" if source.results[0] else "value"]
        passed = [True] * len(source.params)
        return CallSignature(self._alike[key], passed, ways, (), count_of(source))

    def _name(self, word: str) -> str:
        """The reserved name for the first function of a word, a new one for others."""
        name = self._reserved.get(word, "")
        if not name:
            return self.names.new(word)
        self._reserved[word] = ""
        return name

    def _python(self, function: Function, trace: Trace) -> CallSignature:
        source = function.source
        assert source is not None
        if source.loop:
            return self._loop(function)
        word = _word(function)
        body, printed = python_function(self, "@", function, trace, self.contexts[id(function)])
        text = "\n".join(body)
        name = self._alike.get(text)
        if name is None:
            name = self._alike[text] = self._name(identifier(word))
            about = docstring(source.file, source.name)
            heading = f"{word}: {about}" if about else word
            body[0] = body[0].replace(" @(", f" {name}(")
            self.functions.append([*comment(heading), *in_lines(body[0], ""), *body[1:]])
        return CallSignature(name, printed.passed, printed.results, printed.pointers)


def _word(function: Function) -> str:
    """The Python function's own name."""
    assert function.source is not None
    return function.source.name.split(".<locals>.")[-1].removesuffix(".__call__")


def _elementary_text(unit: Unit, name: str, function: Function, trace: Trace) -> list[str]:
    unit.prepare(Context(function), trace)
    names = unit.scope()
    params = {p.number: Expression(names.new("xyzuvw"[i] if i < 6 else f"x_{i}"))
              for i, p in enumerate(function.params)}  # fmt: skip
    printer = Printer(unit, trace, function, names, params)
    printer.block(function.block)
    body = printer.body
    parameters = [f"{TYPES[p.dtype]} {params[p.number].text}" for p in function.params]
    if len(function.results) == 1:
        body.line(f"return {body.operand(function.results[0]).text};")
        head = f"static {TYPES[function.results[0].dtype]} {name}({', '.join(parameters)})"
    else:
        for i, result in enumerate(function.results):
            parameters.append(f"{TYPES[result.dtype]} *out_{i + 1}")
            body.line(f"*out_{i + 1} = {body.operand(result).text};")
        head = f"static void {name}({', '.join(parameters)})"
    return [head, "{", *body.text(), "}"]


def python_function(
    unit: Unit, name: str, function: Function, trace: Trace, context: Context
) -> tuple[list[str], CallSignature]:
    """A function's lines, its head in one, and how it is called."""
    source = function.source
    shapes = ((), ()) if source is None else (source.params, source.results)
    names = unit.scope()
    expressions = {number: Expression(text) for number, text in context.known.items()}
    places = dict(context.kept)
    array_shapes = dict(unit.shapes)
    declarations, passed = _parameters(function, context, names, expressions, array_shapes)
    results: list[str] = []
    assignments: list[tuple[str, Scalar]] = []
    values = []
    arrays = arrays_in(function.results, shapes[1])
    fields = context.results or [False] * len(arrays)
    alone = fields.count(False) == 1
    for array, shape, is_field in zip(arrays, shapes[1], fields, strict=True):
        if is_field:
            results.append("field")
            continue
        small = squeezed(shape)
        if alone and not small:
            results.append("value")
            values.append(array[0])
            continue
        results.append("pointer")
        out = names.new(name_of(trace, array[0], "result"))
        array_shapes[out] = small
        kind = TYPES[array[0].dtype]
        declarations.append(f"{kind} {out}{dimensions(small)}" if small else f"{kind} *{out}")
        for index, x in zip(np.ndindex(small), array, strict=True):
            place = out + "".join(f"[{i}]" for i in index) if small else f"*{out}"
            if isinstance(x, Value) and x.number not in places and x.number not in expressions:
                places[x.number] = place
            else:
                assignments.append((place, x))
    function_name = None if source is None else source.name.split(".<locals>")[0]
    printer = Printer(
        unit, trace, function, names, expressions, places, function_name, array_shapes
    )
    body = printer.body
    assignments += context.left
    body.lines += fills(assignments, places.values())
    printer.block(function.block)
    zeroed = {place.split("[")[0] for place in _many_zeros(assignments)}
    for place, x in assignments:
        if not (_is_zero(x) and place.split("[")[0] in zeroed):
            body.line(f"{place} = {body.operand(x).text};")
    for x in values:
        body.line(f"return {body.operand(x).text};")
    lines = body.text()
    pointers = [one for one in POINTERS if one in unit.types and one in printer.pointers(lines)]
    params = [unit.types[one] for one in pointers] + declarations
    kind = TYPES[values[0].dtype] if values else "void"
    head = f"static {kind} {name}({', '.join(params) or 'void'})"
    return [head, "{", *lines, "}"], CallSignature(name, passed, results, pointers)


FEW = 5
"""At most so many elements of an array that are zero are set one by one."""


def _is_zero(x: Scalar) -> bool:
    return not isinstance(x, Value) and bool(x == 0) and not (x.dtype.kind == "f" and np.signbit(x))


def _many_zeros(assignments: Sequence[tuple[str, Scalar]]) -> dict[str, Scalar]:
    """The arrays that many zeros are assigned to, and the zero."""
    places = [(place.split("[")[0], x) for place, x in assignments if "[" in place and _is_zero(x)]
    count = Counter(place for place, _ in places)
    return {place: x for place, x in places if count[place] > FEW}


def fills(assignments: Sequence[tuple[str, Scalar]], places: Iterable[str]) -> list[str]:
    """Loops that set arrays to zero of which other elements are computed later."""
    every = [*(place for place, _ in assignments), *places]
    lines = []
    for array, zero in _many_zeros(assignments).items():
        indices = [
            [int(i) for i in re.findall(r"\[(\d+)\]", place)]
            for place in every
            if place.split("[")[0] == array
        ]
        indent, subscript = "  ", ""
        for letter, size in zip("ijkmn", map(max, zip(*indices, strict=True)), strict=False):
            lines.append(
                f"{indent}for (int32_t {letter} = 0; {letter} < {size + 1}; {letter}++) {{"
            )
            indent += "  "
            subscript += f"[{letter}]"
        lines.append(f"{indent}{array}{subscript} = {literal(zero).text};")
        lines += ["  " * depth + "}" for depth in range(len(subscript) // 3, 0, -1)]
    return lines


def _parameters(
    function, context, names, expressions, array_shapes
) -> tuple[list[str], list[bool]]:
    """The declarations of array parameters, and which there are.

    Their elements go into `expressions`, their shapes into `array_shapes`.
    """
    declarations, passed = [], []
    if function.source is None:
        return declarations, passed
    shapes = function.source.params
    for array, shape, wish in zip(
        arrays_in(function.params, shapes), shapes, context.wishes, strict=True
    ):
        passed.append(any(x.number not in context.known for x in array))
        if not passed[-1]:
            continue
        name = names.new(wish)
        small, kind = squeezed(shape), TYPES[array[0].dtype]
        array_shapes[name] = small
        declarations.append(
            f"const {kind} {name}{dimensions(small)}" if small else f"{kind} {name}"
        )
        for index, x in zip(np.ndindex(small), array, strict=True):
            expressions[x.number] = Expression(name + "".join(f"[{i}]" for i in index))
    return declarations, passed
