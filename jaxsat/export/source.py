"""controller.h and controller.c of a flight program."""

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from jaxsat.engine.native.builder import Trace
from jaxsat.engine.native.ir import Scalar, Value, definitions, uses
from jaxsat.export.expressions import Expression, literal
from jaxsat.export.helpers import TYPES
from jaxsat.export.naming import Names, comment, identifier
from jaxsat.export.phases import Phase, phases_of
from jaxsat.export.printer import Printer, Unit, element_of, wish_of, wrapped
from jaxsat.export.program import FlightProgram, Stage

GUARD = "CONTROLLER_H"

POINTERS = {
    "p": "const controller_parameters *p",
    "in": "const controller_input *in",
    "attitude": "const {real} attitude[4]",
    "seen": "{const}controller_seen *seen",
    "now": "const controller_state *now",
    "next": "controller_state *next",
    "out": "controller_output *out",
    "s": "{stage}_signals *s",
}
"""What phases may be given, in the order of their parameters."""


def header(program: FlightProgram, intro: Sequence[str]) -> str:
    """controller.h."""
    lines = [*intro, f"#ifndef {GUARD}", f"#define {GUARD}", ""]
    lines += ["#include <stdbool.h>", "#include <stdint.h>", ""]
    if len(program.modes) > 1:
        lines += ["/* The numbers of controller_output.mode */"]
        lines += [
            f"#define CONTROLLER_MODE_{identifier(name).upper()} ({number})"
            for name, number in program.modes.items()
        ]
        lines.append("")
    for name in ("parameters", "input", "state", "output"):
        lines += [*program.structs[name].declaration(), ""]
    real = "float" if program.single else "double"
    lines += [
        "/* The scenario's numbers. */",
        "extern const controller_parameters controller_default_parameters;",
        "",
    ]
    if program.estimates:
        lines += comment(
            "Sets the state before the first sample; attitude is the first estimate (unit "
            "quaternion, scalar first, relative to the orbit frame), in the first measurement."
        )
        attitude = f"const {real} attitude[4], "
    else:
        lines += comment("Sets the state before the first sample, of which in is the measurement.")
        attitude = ""
    lines += [
        f"void controller_init(const controller_parameters *p, {attitude}"
        "const controller_input *in,",
        "                     controller_state *state);",
        "",
        *comment("One sample: reads the measurement, writes the commands and the next state."),
        "void controller_step(const controller_parameters *p, const controller_input *in,",
        "                     controller_state *state, controller_output *out);",
        "",
        f"#endif /* {GUARD} */",
        "",
    ]
    return "\n".join(lines)


def source(program: FlightProgram, intro: Sequence[str], *, libm: bool) -> str:
    """controller.c."""
    unit = Unit(libm, ["p", "in", "seen", "now", "next", "out", "s", "state", "attitude"])
    bodies: list[str] = []
    calls: dict[str, str] = {}
    for stage in (*program.begin, *program.step):
        lines, calls[stage.name] = _stage_text(program, unit, stage)
        bodies += lines
    program.calls.update(calls)
    lines = [*intro, '#include "controller.h"', ""]
    lines += ["#include <float.h>", "#include <math.h>", "#include <string.h>", ""]
    lines += _PRAGMAS
    lines += _defaults(program)
    if program.estimates:
        lines += [*program.structs["seen"].declaration(), ""]
    for table in unit.tables:
        lines += [table, ""]
    for text in unit.helpers.values():
        lines += [text, ""]
    for function in unit.functions:
        lines += [*function, ""]
    return "\n".join([*lines, *bodies, *_entry_points(program, calls), ""])


_PRAGMAS = [
    "#if defined(FLT_EVAL_METHOD) && (FLT_EVAL_METHOD != 0)",
    '#error "floating-point operations must be rounded to their own type"',
    "#endif",
    "#if defined(__FAST_MATH__)",
    '#error "compile without -ffast-math"',
    "#endif",
    "#if defined(__clang__)",
    "#pragma STDC FP_CONTRACT OFF",
    "#endif",
    "",
]


def _defaults(program: FlightProgram) -> list[str]:
    lines = ["const controller_parameters controller_default_parameters = {"]
    fields = program.structs["parameters"].fields
    for field in fields:
        begin = f"  .{field.name} = "
        value = _initialiser(np.asarray(program.parameters[field.number]))
        if len(begin) + len(value) > 98:
            begin, value = begin.rstrip(), "\n".join(wrapped(value))
            lines.append(begin)
        else:
            value = begin + value
        lines.append(f"{value},")
    if not fields:
        lines.append("  .unused = 0,")
    return [*lines, "};", ""]


def _initialiser(array) -> str:
    if array.ndim == 0:
        return literal(array[()]).text
    return "{" + ", ".join(_initialiser(row) for row in array) + "}"


def _stage_text(program: FlightProgram, unit: Unit, stage: Stage) -> tuple[list[str], str]:
    """The functions of a stage, and the call of it."""
    function = stage.program.function
    if not stage.outputs:
        return [], ""
    trace = stage.program.trace
    phases = phases_of(function.block.steps, trace, _root(stage))
    known = {
        param.number: Expression(text)
        for param, text in zip(function.params, stage.inputs, strict=True)
    }
    kept, left = _kept(stage, known)
    signals = _signals(phases, kept, known)
    fields = _signal_fields(trace, signals, kept)
    printed: list[tuple[str, list[str], Phase]] = []
    for phase in phases:
        body = Printer(unit, trace, known, Names(unit.names._taken), kept)
        for one in phases:  # uses in other phases are uses elsewhere
            body.count_steps(one.steps, here=one is phase)
        body.count_results([x for x in function.results if isinstance(x, Value)])
        for step in phase.steps:
            body.step(step)
        for step in phase.steps:
            for made in definitions(step):
                if made.number in kept:
                    known[made.number] = Expression(kept[made.number])
        if phase is phases[-1]:
            for place, result in left:
                body.line(f"{place} = {body.operand(result).text};")
        printed.append((phase.name, body.text(), phase))
    if not phases:
        body = Printer(unit, trace, known, Names(), kept)
        for place, result in left:
            body.line(f"{place} = {body.operand(result).text};")
        printed.append((_root(stage), body.text(), Phase(_root(stage), "", [])))
    return _functions(program, unit, stage, printed, fields)


def _signal_fields(trace: Trace, signals: dict[int, Value], kept: dict[int, str]) -> list[str]:
    """The fields of what phases hand on; `kept` takes the places of the values."""
    names = Names()
    arrays: dict[int, str] = {}
    fields: list[str] = []
    many = Counter(
        element.array for value in signals.values() if (element := element_of(trace, value))
    )
    for number, value in signals.items():
        frames = trace.places.get(number, ())
        about = comment(frames[-1].function)[0] if frames else ""
        element = element_of(trace, value)
        if element is None or many[element.array] == 1:
            name = names.new(wish_of(frames))
            kept[number] = f"s->{name}"
            fields.append(f"  {TYPES[value.dtype]} {name}; {about}")
            continue
        if element.array not in arrays:
            arrays[element.array] = names.new(wish_of(element.place))
            dims = "".join(f"[{n}]" for n in element.shape)
            fields.append(f"  {TYPES[value.dtype]} {arrays[element.array]}{dims}; {about}")
        index = "".join(f"[{i}]" for i in element.index)
        kept[number] = f"s->{arrays[element.array]}{index}"
    return fields


def _root(stage: Stage) -> str:
    return stage.name


def _kept(stage: Stage, known) -> tuple[dict[int, str], list[tuple[str, Scalar]]]:
    """Where results are written as they are made, and those that are written at the end."""
    kept: dict[int, str] = {}
    left = []
    for result, place in zip(stage.program.function.results, stage.outputs, strict=True):
        if isinstance(result, Value) and result.number not in known and result.number not in kept:
            kept[result.number] = place
        else:
            left.append((place, result))
    return kept, left


def _signals(phases: list[Phase], kept, known) -> dict[int, Value]:
    """Values that one phase makes and another reads."""
    maker: dict[int, tuple[int, Value]] = {}
    found: dict[int, Value] = {}
    for number, phase in enumerate(phases):
        for step in phase.steps:
            for used in uses(step):
                if used in maker and maker[used][0] != number and used not in kept:
                    found[used] = maker[used][1]
            for out in definitions(step):
                maker[out.number] = (number, out)
    del known
    return found


def _functions(
    program: FlightProgram,
    unit: Unit,
    stage: Stage,
    printed: list[tuple[str, list[str], Phase]],
    fields: list[str],
) -> tuple[list[str], str]:
    real = "float" if program.single else "double"
    lines: list[str] = [f"/* {stage.title} */", ""]
    if fields:
        lines += comment(f"What the phases of {stage.name} hand on.")
        lines += ["typedef struct {", *fields, f"}} {stage.name}_signals;", ""]
    calls = []
    writes_seen = stage.name == "estimate"
    given: set[str] = set()
    for word, body, phase in printed:
        text = "\n".join(body)
        wanted = [
            name for name in POINTERS
            if re.search(rf"(?<![\w>.]){name}{'->' if name != 'attitude' else chr(92) + '['}", text)
        ]  # fmt: skip
        given |= set(wanted)
        name = (
            stage.name if len(printed) == 1 else unit.names.new(f"{stage.name}_{identifier(word)}")
        )
        params = [
            POINTERS[one].format(real=real, stage=stage.name, const="" if writes_seen else "const ")
            for one in wanted
        ]
        if len(printed) > 1 and phase.name != phase.caller:
            lines += comment(f"{phase.name}, called by {phase.caller}")
        lines += [f"static void {name}({', '.join(params) or 'void'})", "{", *body, "}", ""]
        calls.append(f"{name}({', '.join(wanted)});")
    if len(printed) == 1:
        return lines, calls[0]
    given.discard("s")
    wanted = [name for name in POINTERS if name in given]
    params = [
        POINTERS[one].format(real=real, stage=stage.name, const="" if writes_seen else "const ")
        for one in wanted
    ]
    lines += [f"static void {stage.name}({', '.join(params)})", "{"]
    if fields:
        lines += [f"  {stage.name}_signals signals;", f"  {stage.name}_signals *s = &signals;", ""]
    lines += [*(f"  {call}" for call in calls), "}", ""]
    return lines, f"{stage.name}({', '.join(wanted)});"


def _entry_points(program: FlightProgram, calls: dict[str, str]) -> list[str]:
    real = "float" if program.single else "double"
    attitude = f"const {real} attitude[4], " if program.estimates else ""
    begin = [
        f"void controller_init(const controller_parameters *p, {attitude}"
        "const controller_input *in,",
        "                     controller_state *state)",
        "{",
        "  controller_state *next = state;",
    ]
    body = []
    if program.estimates:
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
        for name in ("p", "in", "attitude", "next")
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
    body = []
    if program.estimates:
        step += ["  controller_seen told;", "  controller_seen *seen = &told;"]
    body += [f"  {calls[name]}" for name in ("estimate", "control", "allocate") if calls.get(name)]
    text = "\n".join(body)
    unused = [
        f"  (void){name};"
        for name in ("p", "in", "now", "next", "out")
        if not re.search(rf"(?<!\w){name}(?!\w)", text)
    ]
    return [*begin, *step, "", *unused, *body, "  *state = after;", "}"]
