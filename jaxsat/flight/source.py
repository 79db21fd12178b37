"""controller.h and controller.c of a flight program."""

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from jaxsat.compiler.c.contexts import Context
from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.functions import Unit
from jaxsat.compiler.c.layout import Field
from jaxsat.compiler.c.naming import comment
from jaxsat.compiler.c.python_functions import python_function
from jaxsat.compiler.c.tidying import wrapped
from jaxsat.compiler.ir import NamedNumber, Source, Value
from jaxsat.flight.flight import FlightController
from jaxsat.flight.guard import real_type
from jaxsat.flight.program import STRUCTURES, FlightProgram, ProgramStage
from jaxsat.flight.templates import template

TYPES_OF_POINTERS = {
    "p": "const controller_parameters *p",
    "at": "const controller_clock *at",
    "in": "const controller_input *in",
    "attitude": "const {real} attitude[4]",
    "seen": "const controller_seen *seen",
    "now": "const controller_state *now",
    "next": "controller_state *next",
    "out": "controller_output *out",
}


def header(program: FlightProgram, intro: Sequence[str]) -> str:
    """Return the text of controller.h."""
    structures = [
        "".join(f"{line}\n" for line in program.structs[name].declaration())
        for name in ("parameters", "input", "state", "output")
    ]
    about = "Sets the state before the first sample, of which in is the measurement."
    if program.estimates:
        about = (
            "Sets the state before the first sample; attitude is the first estimate (unit "
            "quaternion, scalar first, relative to the orbit frame), in the first measurement."
        )
    about_coast = "One sample of the estimator alone, in which the controller makes no commands."
    coast = "\n".join([*comment(about_coast), *_coast_head(";"), "", ""])
    text = template(
        "controller.h",
        MODES="".join(_defines(program)),
        STRUCTURES="\n".join(structures),
        ABOUT_INIT="\n".join(comment(about)),
        ATTITUDE=f"const {real_type(program)} attitude[4], " * program.estimates,
        COAST=coast * program.estimates,
    )
    return "\n".join([*intro, text])


def _defines(program: FlightProgram) -> Iterator[str]:
    """Yield the macros of each enumeration, after the fields that have its numbers."""
    for choices, names in program.macros.items():
        places = [
            f"controller_{name}.{one.name}"
            for name in ("output", "state", "parameters")
            for one in program.structs[name].fields
            if one.choices is choices
        ]
        lines = comment(f"The numbers of {', '.join(places)}")
        lines += [f"#define {name} INT32_C({number})" for number, name in names.items()]
        yield "\n".join([*lines, "", ""])


def _coast_head(end: str) -> list[str]:
    return [
        "void controller_coast(const controller_parameters *p, const controller_input *in,",
        f"                      controller_state *state){end}",
    ]


def source(program: FlightProgram, intro: Sequence[str], *, libm: bool) -> str:
    """Return the text of controller.c."""
    real = real_type(program)
    types = {name: text.format(real=real) for name, text in TYPES_OF_POINTERS.items()}
    if not program.estimates:
        del types["seen"], types["attitude"]
    unit = Unit(libm, types, _shapes(program))
    calls = {stage.name: _stage(unit, stage) for stage in (*program.begin, *program.step)}
    program.calls.update(calls)
    program.functions.update(unit.of_numbers)
    program.origins.update(unit.origins)
    program.wholes.update(unit.wholes)
    lines = [*intro, '#include "controller.h"', ""]
    lines += ["#include <float.h>", "#include <math.h>", "#include <string.h>", ""]
    lines += _PRAGMAS
    lines += _defaults(program)
    if any(reads_clock(call) for call in calls.values()):
        unit.need("sub", np.dtype(np.int32))
        lines += [*program.structs["clock"].declaration(), ""]
    if program.estimates:
        lines += [*program.structs["seen"].declaration(), ""]
    functions = [line for function in unit.functions for line in (*function, "")]
    functions += [*_entry_points(program, calls), ""]
    text = "\n".join([*lines, *unit.used("\n".join(functions)), *functions])
    words = set(re.findall(r"\w+", text))
    program.operations.update((k, x) for k, x in unit.operations.items() if k in words)
    return text


def reads_clock(call: str) -> bool:
    """Whether a stage with this call reads the number of the sample."""
    return re.search(r"\bat\b", call) is not None


def _shapes(program: FlightProgram) -> dict[str, tuple[int, ...]]:
    """Return the shapes of all arrays in structures, by the names in functions."""
    return {"attitude": (4,)} | {
        f"{pointer}->{field.name}": field.shape
        for pointer, struct in STRUCTURES.items()
        for field in program.structs[struct].fields
    }


_PRAGMAS = [
    "#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD != 0)",
    '#error "floating-point operations must be rounded to their own type"',
    "#endif",
    "#if defined(__FAST_MATH__)",
    '#error "compile without -ffast-math"',
    "#endif",
    "#if defined(__clang__)",
    "#pragma STDC FP_CONTRACT OFF",
    "#elif defined(__GNUC__) && (__GNUC__ >= 12)",
    "/* GCC 12 takes a field's address, which it computes from the one before, as beyond that. */",
    '#pragma GCC diagnostic ignored "-Wstringop-overflow"',
    "#endif",
    "",
]


def _defaults(program: FlightProgram) -> list[str]:
    begin = "const controller_parameters controller_default_parameters = {"
    return [begin, *default_parameters(program), "};", ""]


def default_parameters(program: FlightProgram) -> list[str]:
    """Return the scenario's numbers as lines of an initialiser of `controller_parameters`."""
    fields = program.structs["parameters"].fields
    lines = initialisers(fields, program.parameters, program.macros)
    return lines or ["  .unused = 0,"]


def initialisers(
    fields: Sequence[Field], values: Sequence[Any], macros: Mapping[Any, Mapping[int, str]]
) -> list[str]:
    """Return the lines of an initialiser of a structure, whose fields have numbers of values.

    `macros` has the names of the numbers of enumerations.
    """
    lines = []
    for field in fields:
        begin = f"  .{field.name} = "
        names = {} if field.choices is None else macros[field.choices]
        value = _initialiser(np.asarray(values[field.number], field.dtype), names)
        if len(begin) + len(value) > 98:
            begin, value = begin.rstrip(), "\n".join(wrapped(value))
            lines.append(begin)
        else:
            value = begin + value
        lines.append(f"{value},")
    return lines


def _initialiser(array, names: Mapping[int, str]) -> str:
    if array.ndim == 0:
        return literal(NamedNumber.of(array[()], names)).text
    return "{" + ", ".join(_initialiser(row, names) for row in array) + "}"


def _stage(unit: Unit, stage: ProgramStage) -> str:
    """Print the function of a stage, and return its call."""
    function = stage.program.function
    if not stage.outputs:
        return ""
    texts = {param.number: text for param, text in zip(function.params, stage.inputs, strict=True)}
    begin = Context(function, texts)
    for result, place in zip(function.results, stage.outputs, strict=True):
        expressions = {**texts, **begin.places}
        if isinstance(result, Value) and result.number not in expressions:
            begin.places[result.number] = place
        else:
            begin.assignments.append((place, result))
    trace = stage.program.trace
    if "seen" in unit.types:
        const = "" if stage.name == "estimate" else "const "
        unit.types["seen"] = const + unit.types["seen"].removeprefix("const ")
    unit.prepare(begin, trace)
    name = unit.names.new(stage.name)
    text, names, code = python_function(unit, stage.title, function, trace, begin)
    unit.write(text, names, lambda: name)
    place = inspect.getfile(FlightController)
    unit.origins[name] = [Source(f"{FlightController.__name__}.{stage.name}", place, (), ())]
    return f"{name}({', '.join(code.pointers)});"


def _clock(sample: str) -> list[str]:
    return [
        f"  const controller_clock passed = {{.sample = {sample}}};",
        "  const controller_clock *at = &passed;",
    ]


def _entry_points(program: FlightProgram, calls: dict[str, str]) -> list[str]:
    real = real_type(program)
    attitude = f"const {real} attitude[4], " if program.estimates else ""
    begin = [
        f"void controller_init(const controller_parameters *p, {attitude}"
        "const controller_input *in,",
        "                     controller_state *state)",
        "{",
        "  controller_state *next = state;",
    ]
    body = ["  state->begin_sample = in->sample;"]
    if program.estimates:
        begin += _clock("0") if reads_clock(calls["estimate"]) else []
        body += [
            "  const controller_state *now = state;",
            "  controller_seen first;",
            "  controller_seen *seen = &first;",
            "  controller_state after_first;",
            "",
            f"  {calls['begin_estimator']}",
            "  after_first = *state;",
            "  next = &after_first;",
            f"  {calls['estimate']}",
            "  next = state;",
        ]
    body += [f"  {calls[name]}" for name in ("begin_law", "begin_modulation") if calls[name]]
    text = "\n".join(body)
    unused = [
        f"  (void){name};"
        for name in ("p", "attitude", "next")
        if (name != "attitude" or program.estimates)
        and not re.search(rf"(?<!\w){name}(?!\w)", text)
    ]
    begin += [*unused, *body, "}", ""]
    step = [
        "void controller_step(const controller_parameters *p, const controller_input *in,",
        "                     controller_state *state, controller_output *out)",
        "{",
        "  controller_state after = *state;",
        "  controller_state *next = &after;",
        "  const controller_state *now = state;",
    ]
    clock = _clock("sub_i32(in->sample, state->begin_sample)")
    stages = [name for name in ("estimate", "control", "allocate") if calls.get(name)]
    functions = [*begin, *step, *_sample(calls, stages, clock, program.estimates, "out")]
    if not program.estimates:
        return functions
    coast = [*_coast_head(""), *step[2:], *_sample(calls, ["estimate"], clock, True)]
    return [*functions, "", *coast]


def _sample(
    calls: dict[str, str], stages: Sequence[str], clock: list[str], estimates: bool, *more: str
) -> list[str]:
    """Return the end of a function of these stages; `more` are its own arguments."""
    lines = clock if any(reads_clock(calls[name]) for name in stages) else []
    if estimates:
        lines = [*lines, "  controller_seen told;", "  controller_seen *seen = &told;"]
    body = [f"  {calls[name]}" for name in stages]
    text = "\n".join(body)
    unused = [
        f"  (void){name};"
        for name in ("p", "in", "now", "next", *more)
        if not re.search(rf"(?<!\w){name}(?!\w)", text)
    ]
    return [*lines, "", *unused, *body, "  *state = after;", "}"]
