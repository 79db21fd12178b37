"""Functions of C: those of the programs' Python code, elementary ones, and tables of constants."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from jaxsat.compiler.c.body import Body
from jaxsat.compiler.c.contexts import Context, contexts
from jaxsat.compiler.c.cutting import Text, in_parts, lines_of
from jaxsat.compiler.c.expressions import Expression, literal
from jaxsat.compiler.c.helpers import DECIDES, TYPES, count_of, helper, loop_text
from jaxsat.compiler.c.naming import Names, comment, docstring, identifier
from jaxsat.compiler.c.printer import Printer
from jaxsat.compiler.c.python_functions import python_function
from jaxsat.compiler.c.tidying import WIDEST, braced, dimensions, in_lines
from jaxsat.compiler.c.unit import AbstractUnit, CallSignature
from jaxsat.compiler.ir import Function, Memory, NamedNumber, Source
from jaxsat.compiler.trace import Trace

LIBM = frozenset((
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf",
    "erfc", "exp", "exp2", "expm1", "log", "log1p", "pow", "sin", "sinh", "tan", "tanh"
))  # fmt: skip
"""Elementary functions that the C library provides."""


class Unit(AbstractUnit):
    """A C file during printing: the static functions and tables that its programs need.

    `of_numbers` are the elementary functions of floats alone, by name, and `operations` the helpers
    that have branches, as operation and types of operands and result; `contexts` are those of the
    functions of the current stage; `types` of the pointers to structures, and `shapes` of their
    arrays. `origins` has the Python functions of each C function, and `wholes` the function that
    each part belongs to.
    """

    def __init__(self, libm: bool, types: dict[str, str], shapes: dict[str, tuple[int, ...]]):
        self.libm, self.types, self.shapes = libm, types, shapes
        self.names = Names(types)
        self.helpers: dict[str, str] = {}
        self.tables: dict[str, str] = {}
        self.functions: list[list[str]] = []
        self.of_numbers: dict[str, Function] = {}
        self.operations: dict[str, tuple[str, np.dtype, np.dtype]] = {}
        self.origins: dict[str, list[Source]] = {}
        self.wholes: dict[str, str] = {}
        self.contexts: dict[int, Context] = {}
        self._reserved: dict[str, str] = {}
        self._printed: dict[int, CallSignature] = {}
        self._alike: dict[str, str] = {}
        self._tables: dict[tuple, str] = {}

    def scope(self) -> Names:
        """Return a new scope of names of a function, none of which the file has."""
        return Names(self.types, outer=self.names)

    def need(self, name: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """Return the name of a helper, which is printed once."""
        full, text, needs = helper(name, dtype, other)
        if full not in self.helpers:
            for one in needs:
                self.need(*one)
            self.helpers[full] = text
            if name in DECIDES:
                self.operations[full] = (DECIDES[name], dtype, other or dtype)
        return full

    def used(self, text: str) -> list[str]:
        """Return the tables and helpers that a text of functions uses, directly or not.

        A statement that was removed as dead may have been the only one to use them.
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
        """Return the name of an indexed array of constants."""
        assert memory.initial is not None
        numbers = [NamedNumber.of(x, memory.names) for x in memory.initial]
        return self.table(numbers, (memory.size,), "constant")

    def table(self, numbers: Sequence[np.generic], shape: tuple[int, ...], wish: str) -> str:
        """Return the name of an array of constants; equal ones are shared."""
        kind = TYPES[numbers[0].dtype]
        text = braced([literal(x).text for x in numbers], shape)
        key = (kind, shape, text)
        if key not in self._tables:
            name = self._tables[key] = self.names.new(f"{wish}_table")
            head = f"static const {kind} {name}{dimensions(shape)} = "
            self.tables[name] = "\n".join(in_lines(f"{head}{text};", ""))
        return self._tables[key]

    def elementary(self, function: Function, trace: Trace) -> str:
        """Return the name of an elementary function of numbers."""
        word = function.name.split(".")[0]
        if self.libm and word in LIBM:
            return word + ("f" if function.results[0].dtype.itemsize == 4 else "")
        if id(function) not in self._printed:
            name = self.names.new(identifier(f"{word}_of" if word in LIBM else word))
            text, names = _elementary_text(self, function, trace)
            name = self.write(text, names, lambda: name)
            self._printed[id(function)] = CallSignature(name, (), (), ())
            if {one.dtype.kind for one in (*function.params, *function.results)} == {"f"}:
                self.of_numbers[name] = function
        return self._printed[id(function)].name

    def python(self, function: Function, trace: Trace) -> CallSignature:
        """Print a function of the Python code once, and return its signature."""
        if id(function) not in self._printed:
            self._printed[id(function)] = self._python(function, trace)
        return self._printed[id(function)]

    def prepare(self, begin: Context, trace: Trace) -> None:
        """Print all functions that a function calls, callees first."""
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

    def write(self, text: Text, names: Names, new_name: Callable[[], str]) -> str:
        """Print a function, in parts if it is long, and return its name.

        `names` are those that it uses. One like another is not printed again.
        """
        parts = in_parts(text, names)
        key = "\n".join(
            line
            for one in parts.functions
            for line in (one.head, *one.parameters.values(), *one.lines)
        )
        if key not in self._alike:
            name = self._alike[key] = new_name()
            words = {
                word: self.names.new(f"{name}_{'part' if f'_{wish}_' in f'_{name}_' else wish}")
                for word, wish in parts.wishes.items()
            }
            self.wholes |= {words[part]: name for part in parts.wishes if part.isdecimal()}
            words[""] = name
            for record in ("arguments", "results"):
                words[record] = f"{name}_{record}"
                self.names.identifiers.add(words[record])
            lines = list(parts.declarations)
            for one in parts.functions:
                lines += [*comment(one.about), *lines_of(one), ""]
            self.functions.append([line for one in lines for line in _named(one, words)][:-1])
        return self._alike[key]

    def _loop(self, function: Function) -> CallSignature:
        """Print an operation on arrays, once for all of one kind."""
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
        """Return the reserved name for the first function of a word, a new one for others."""
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
        about = docstring(source.file, source.name)
        heading = f"{word}: {about}" if about else word
        context = self.contexts[id(function)]
        text, names, printed = python_function(self, heading, function, trace, context)
        name = self.write(text, names, lambda: self._name(identifier(word)))
        self.origins.setdefault(name, []).append(source)
        arguments, outputs = (
            one and replace(one, kind=one.kind.replace("@", f"{name}_"))
            for one in (printed.arguments, printed.outputs)
        )
        return replace(printed, name=name, arguments=arguments, outputs=outputs)


def _word(function: Function) -> str:
    assert function.source is not None
    return function.source.name.split(".<locals>.")[-1].removesuffix(".__call__")


def _named(line: str, words: dict[str, str]) -> list[str]:
    """Return a line with names in place of their symbols."""
    if "@" not in line and len(line) <= WIDEST:
        return [line]
    indent = " " * (len(line) - len(line.lstrip()))
    return in_lines(re.sub(r"@(\w*)", lambda match: words[match[1]], line.strip()), indent)


def _elementary_text(unit: Unit, function: Function, trace: Trace) -> tuple[Text, Names]:
    unit.prepare(Context(function), trace)
    names = unit.scope()
    params = {p.number: Expression(names.new("xyzuvw"[i] if i < 6 else f"x_{i}"))
              for i, p in enumerate(function.params)}  # fmt: skip
    body = Body(trace, function, names, params)
    Printer(unit, body).block(function.block)
    parameters = {
        params[p.number].text: f"{TYPES[p.dtype]} {params[p.number].text}" for p in function.params
    }
    if len(function.results) == 1:
        body.line(f"return {body.operand(function.results[0]).text};")
        kind = TYPES[function.results[0].dtype]
    else:
        for i, result in enumerate(function.results):
            parameters[f"out_{i + 1}"] = f"{TYPES[result.dtype]} *out_{i + 1}"
            body.line(f"*out_{i + 1} = {body.operand(result).text};")
        kind = "void"
    return Text(f"static {kind} @", parameters, body.text()), names
