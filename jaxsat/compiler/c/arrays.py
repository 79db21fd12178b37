"""Arrays of C in place of many scalars: arguments, results and memory."""

import re
from collections.abc import Iterable, Sequence

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.c.body import Body
from jaxsat.compiler.c.contexts import base_of, column_of, has_rows
from jaxsat.compiler.c.expressions import UNARY, Expression
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.naming import element_of, name_of
from jaxsat.compiler.c.tidying import braced, dimensions
from jaxsat.compiler.c.unit import AbstractUnit

CONSTANT = ("p", "in", "now")
"""Structures that are only read."""


class Arrays:
    """Arrays of one C function."""

    def __init__(self, unit: AbstractUnit, body: Body):
        self._unit, self._body = unit, body
        self._memories: dict[int, str] = {}
        self._gathered: dict[tuple[int, str], str] = {}
        self._constant = {one.text.split("[")[0] for one in body.expressions.values()}

    def memory(self, memory: ir.Memory) -> str:
        """Return the name of an indexed array."""
        if memory.elements:
            return self.argument(memory.elements, (memory.size,)).text
        if memory.initial is not None:
            return self._unit.memory(memory)
        if memory.number not in self._memories:
            name = self._body.names.new("array")
            self._memories[memory.number] = name
            self._body.line(f"{TYPES[memory.dtype]} {name}[{memory.size}];")
        return self._memories[memory.number]

    def element(self, memory: ir.Memory, index: str) -> str:
        """Return the element of an indexed array, which may be a column of another one."""
        values = [x for x in memory.elements if isinstance(x, ir.Value)]
        expressions = [self._body.expressions.get(x.number) for x in values]
        texts = [one.text for one in expressions if one is not None]
        if texts and len(texts) == memory.size and (column := column_of(texts)):
            return f"{column[0]}[{index}]{column[1]}"
        return f"{self.memory(memory)}[{index}]"

    def declare(self, blocks: Iterable[ir.Block]) -> None:
        """Declare the arrays of inner blocks before these."""
        for block in blocks:
            for step in block.steps:
                match step:
                    case ir.Load(memory=memory) | ir.Store(memory=memory) if not memory.elements:
                        self.memory(memory)
                    case _:
                        self.declare(ir.blocks_in(step))

    def argument(self, array: Sequence[ir.Scalar], shape: tuple[int, ...]) -> Expression:
        """Return a number, or an array of C with these elements."""
        if not shape:
            return self._body.operands(array)[0]
        if not any(isinstance(x, ir.Value) for x in array):
            return Expression(self._unit.table(array, shape, "constant"))  # pyright: ignore
        self._complete(array, shape)
        expressions = self._body.expressions
        texts = [
            expressions[x.number].text
            if isinstance(x, ir.Value) and x.number in expressions
            else None
            for x in array
        ]
        base = base_of(texts, shape)
        if base is None or not has_rows(base, shape, self._body.shapes):
            return Expression(self._gather(array, shape))
        begin = re.split(r"\W", base)[0]
        if len(shape) > 1 and begin not in CONSTANT and begin not in self._constant:
            kind = TYPES[array[0].dtype]
            return Expression(f"(const {kind} (*){dimensions(shape[1:])}){base}", UNARY)
        return Expression(base)

    def receiver(
        self, array: Sequence[ir.Value], shape: tuple[int, ...], after: list[tuple[str, str]]
    ) -> Expression:
        """Return the target of an array of results; `after` the call some are copied elsewhere."""
        body = self._body
        if not shape:
            return Expression(f"&{body.place(array[0])}".replace("&*", ""))
        texts = [body.places.get(out.number) for out in array]
        base = base_of(texts, shape)
        if base is None or not has_rows(base, shape, body.shapes):
            base = body.names.new(name_of(body.trace, array[0], "result"))
            body.line(f"{TYPES[array[0].dtype]} {base}{dimensions(shape)};")
            body.shapes[base] = shape
        for index, out, text in zip(np.ndindex(shape), array, texts, strict=True):
            place = base + "".join(f"[{i}]" for i in index)
            body.expressions[out.number] = Expression(place)
            if text is not None and text != place:
                after.append((text, place))
                body.expressions[out.number] = Expression(text)
        return Expression(base)

    def found(
        self,
        array: Sequence[ir.Value],
        shape: tuple[int, ...],
        base: str,
        after: list[tuple[str, str]],
    ) -> None:
        """Take an array of results from a record; `after` the call some are copied elsewhere."""
        body = self._body
        body.shapes[base] = shape
        for index, out in zip(np.ndindex(shape), array, strict=True):
            place = base + "".join(f"[{i}]" for i in index)
            text = body.places.get(out.number)
            if text is not None:
                after.append((text, place))
            body.expressions[out.number] = Expression(text or place)

    def _gather(self, array: Sequence[ir.Scalar], shape: tuple[int, ...]) -> str:
        """Return the name of a new array of these elements; equal ones of a block are shared."""
        numbers = braced([self._body.operand(x).text for x in array], shape)
        key = (self._body.scope, numbers)
        if key not in self._gathered:
            name = self._body.names.new(name_of(self._body.trace, array[0], "given"))
            self._gathered[key] = name
            kind = TYPES[array[0].dtype]
            self._body.wrapped(f"const {kind} {name}{dimensions(shape)} = {numbers};")
        return self._gathered[key]

    def _complete(self, array: Sequence[ir.Scalar], shape: tuple[int, ...]) -> None:
        """Put elements that should belong to an array of C, and do not yet, into it."""
        trace = self._body.trace
        elements = [element_of(trace, x) if isinstance(x, ir.Value) else None for x in array]
        first = elements[0]
        if first is None:
            return
        row = first.index[: len(first.index) - len(shape)]
        row_elements = [(first.array, (*row, *index)) for index in np.ndindex(shape)]
        if row_elements != [e and (e.array, e.index) for e in elements]:
            return
        if first.shape[len(row) :] != shape:
            return

        def belongs(value: ir.Value) -> bool:
            element = element_of(trace, value)
            return element is not None and element.array == first.array

        self._body.name_pending(belongs)
