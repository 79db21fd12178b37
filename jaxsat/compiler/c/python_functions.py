"""C functions of Python functions: parameters, body and results."""

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from jaxsat.compiler.c.body import Body
from jaxsat.compiler.c.contexts import Context, arrays_in, squeezed
from jaxsat.compiler.c.cutting import Text
from jaxsat.compiler.c.expressions import Expression, literal
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.naming import COUNTERS, Names, name_of
from jaxsat.compiler.c.printer import Printer
from jaxsat.compiler.c.tidying import dimensions
from jaxsat.compiler.c.unit import POINTERS, AbstractUnit, CallSignature, Record
from jaxsat.compiler.ir import Function, Scalar, Value
from jaxsat.compiler.trace import Trace

MOST = 9
"""Largest number of parameters of a function; more are in records. A part may have one more."""


def python_function(
    unit: AbstractUnit, about: str, function: Function, trace: Trace, context: Context
) -> tuple[Text, Names, CallSignature]:
    """Return a function as text, the names that it uses, and its signature.

    If there are too many parameters, the arguments, the results or both are in records.
    """
    printed = _printed(unit, about, function, trace, context, (False, False))
    text, _, call = printed
    count = len(text.parameters)
    if count <= MOST:
        return printed
    results = call.results.count("pointer")
    arguments = count - results - len(call.pointers)
    in_records = arguments >= results, arguments < results
    if len(call.pointers) + 1 + min(arguments, results) > MOST:
        in_records = True, True
    return _printed(unit, about, function, trace, context, in_records)


def _printed(
    unit: AbstractUnit,
    about: str,
    function: Function,
    trace: Trace,
    context: Context,
    in_records: tuple[bool, bool],
) -> tuple[Text, Names, CallSignature]:
    """Print as `python_function`, with arguments and results in records or not."""
    source = function.source
    shapes = ((), ()) if source is None else (source.params, source.results)
    names = unit.scope()
    expressions = {number: Expression(text) for number, text in context.expressions.items()}
    places = dict(context.places)
    array_shapes = dict(unit.shapes)
    inputs = names.new("given") if in_records[0] else ""
    outputs = names.new("found") if in_records[1] else ""
    arguments, passed = _parameters(
        function, context, names, f"{inputs}->" if inputs else "", expressions, array_shapes
    )
    outs: dict[str, str] = {}
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
        name = names.new(name_of(trace, array[0], "result"))
        kind = TYPES[array[0].dtype]
        outs[name] = f"{kind} {name}{dimensions(small)}" if small or outputs else f"{kind} *{name}"
        out = f"{outputs}->{name}" if outputs else name
        array_shapes[out] = small
        scalar = out if outputs else f"*{out}"
        for index, x in zip(np.ndindex(small), array, strict=True):
            place = out + "".join(f"[{i}]" for i in index) if small else scalar
            if isinstance(x, Value) and x.number not in places and x.number not in expressions:
                places[x.number] = place
            else:
                assignments.append((place, x))
    function_name = None if source is None else source.name.split(".<locals>")[0]
    body = Body(trace, function, names, expressions, places, function_name, array_shapes)
    printer = Printer(unit, body)
    assignments += context.assignments
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
    params = {one: unit.types[one] for one in pointers}
    params |= {inputs: f"const @arguments *{inputs}"} if inputs else arguments
    params |= {outputs: f"@results *{outputs}"} if outputs else outs
    records = (
        Record("@arguments", arguments) if inputs else None,
        Record("@results", outs) if outputs else None,
    )
    declarations = [line for one in records if one is not None for line in one.declaration()]
    kind = TYPES[values[0].dtype] if values else "void"
    text = Text(f"static {kind} @", params, lines, about, declarations)
    return text, names, CallSignature("@", passed, results, pointers, (), *records)


FEW = 5
"""Largest number of zero elements of an array that are set one by one."""


def _is_zero(x: Scalar) -> bool:
    return not isinstance(x, Value) and bool(x == 0) and not (x.dtype.kind == "f" and np.signbit(x))


def _many_zeros(assignments: Sequence[tuple[str, Scalar]]) -> dict[str, Scalar]:
    places = [(place.split("[")[0], x) for place, x in assignments if "[" in place and _is_zero(x)]
    count = Counter(place for place, _ in places)
    return {place: x for place, x in places if count[place] > FEW}


def fills(assignments: Sequence[tuple[str, Scalar]], places: Iterable[str]) -> list[str]:
    """Return loops that set to zero arrays with some elements computed later."""
    every = [*(place for place, _ in assignments), *places]
    lines = []
    for array, zero in _many_zeros(assignments).items():
        indices = [
            [int(i) for i in re.findall(r"\[(\d+)\]", place)]
            for place in every
            if place.split("[")[0] == array
        ]
        indent, subscript = "  ", ""
        for letter, size in zip(COUNTERS, map(max, zip(*indices, strict=True)), strict=False):
            lines.append(
                f"{indent}for (int32_t {letter} = 0; {letter} < {size + 1}; {letter}++) {{"
            )
            indent += "  "
            subscript += f"[{letter}]"
        lines.append(f"{indent}{array}{subscript} = {literal(zero).text};")
        lines += ["  " * depth + "}" for depth in range(len(subscript) // 3, 0, -1)]
    return lines


def _parameters(
    function, context, names, begin, expressions, array_shapes
) -> tuple[dict[str, str], list[bool]]:
    """Return the declarations of array parameters by name, and which are passed.

    Their elements go into `expressions`, their shapes into `array_shapes`; `begin` is the prefix of
    fields of a record.
    """
    declarations: dict[str, str] = {}
    passed: list[bool] = []
    if function.source is None:
        return declarations, passed
    shapes = function.source.params
    for array, shape, wish in zip(
        arrays_in(function.params, shapes), shapes, context.wishes, strict=True
    ):
        passed.append(any(x.number not in context.expressions for x in array))
        if not passed[-1]:
            continue
        name = names.new(wish)
        small, kind = squeezed(shape), TYPES[array[0].dtype]
        array_shapes[begin + name] = small
        pointer = f"(*{name})" if len(small) > 1 else f"*{name}"
        declaration = f"{pointer}{dimensions(small[1:])}" if begin else f"{name}{dimensions(small)}"
        declarations[name] = f"const {kind} {declaration}" if small else f"{kind} {name}"
        for index, x in zip(np.ndindex(small), array, strict=True):
            expressions[x.number] = Expression(begin + name + "".join(f"[{i}]" for i in index))
    return declarations, passed
