"""controller_library.c: the stages of the controller for many cases at once, for simulators."""

import re
from collections.abc import Sequence

from jaxsat.compiler.c.layout import Struct
from jaxsat.flight.harness import reader, writer
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import reads_clock

STAGES = ("estimate", "control")


def library_source(program: FlightProgram, intro: Sequence[str]) -> str:
    """The file; it takes in controller.c, whose stages nobody else can call.

    A row of parameters, inputs and state goes in for each case; the next state and the law's torque
    and mode (`control`), or what the law is told (`estimate`), come out.
    """
    structs = program.structs
    lines = [*intro, '#include "controller.c"', '#include "controller_records.h"', ""]
    lines += reader(structs["parameters"])
    if program.estimates:
        lines += [*reader(structs["seen"]), *writer(structs["seen"])]
    lines += [
        "const char *controller_program(void);",
        "const char *controller_program(void)",
        "{",
        f'  return "{program.hash}{"-single" if program.single else ""}";',
        "}",
        "",
    ]
    if program.estimates:
        lines += _batch(program, "estimate", seen_in=False)
    lines += _batch(program, "control", seen_in=program.estimates)
    return "\n".join(lines)


def _batch(program: FlightProgram, stage: str, *, seen_in: bool) -> list[str]:
    structs = program.structs
    head = f"void controller_{stage}_batch(int64_t count, const double *rows, double *found)"
    sizes = [structs["parameters"].size, structs["input"].size]
    sizes += [structs["seen"].size] if seen_in else []
    sizes += [structs["state"].size]
    writes_seen = stage == "estimate"
    out: Struct = structs["seen"] if writes_seen else structs["output"]
    lines = [
        f"{head};",
        head,
        "{",
        "  for (int64_t case_number = 0; case_number < count; case_number++) {",
    ]
    lines += [
        "    controller_parameters parameters;",
        "    controller_input input;",
        "    controller_state before;",
        "    controller_state after;",
    ]
    uses_out = not writes_seen
    if uses_out:
        lines += ["    controller_output output;"]
    if program.estimates:
        lines += ["    controller_seen told;"]
    clocked = reads_clock(program.calls[stage])
    lines += ["    controller_clock clock;"] if clocked else []
    place = 0
    names = [("parameters", "parameters"), ("input", "input")]
    names += [("seen", "told")] if seen_in else []
    names += [("state", "before")]
    for (struct, variable), size in zip(names, sizes, strict=True):
        lines.append(f"    read_controller_{struct}(rows + {place}, &{variable});")
        place += size
    if uses_out:
        lines.append("    (void)memset(&output, 0, sizeof(output));")
    if clocked:
        real = "(float)" if program.single else ""
        lines += [f"    clock.time = {real}input.time;", "    clock.sample = input.sample;"]
    lines += ["    after = before;", f"    {_call(program, stage)}"]
    source = "told" if writes_seen else "output"
    lines += [
        f"    write_controller_{'seen' if writes_seen else 'output'}(&{source}, found);",
        f"    write_controller_state(&after, found + {out.size});",
        f"    rows += {place};",
        f"    found += {out.size + structs['state'].size};",
        "  }",
        "}",
        "",
    ]
    return lines


def _call(program: FlightProgram, stage: str) -> str:
    call = program.calls[stage]
    given = {
        "p": "&parameters", "at": "&clock", "in": "&input", "seen": "&told", "now": "&before",
        "next": "&after", "out": "&output",
    }  # fmt: skip
    name, _, rest = call.partition("(")
    args = [given[arg] for arg in re.findall(r"\w+", rest)]
    return f"{name}({', '.join(args)});"
