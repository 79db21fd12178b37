"""What stands around the controller: records of numbers, the test program, and
controller_library.c, its stages for many cases at once, for software in the loop."""

import re
from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import reads_clock
from jaxsat.flight.templates import template
from jaxsat.flight.vectors import Vectors

MAGIC = 0x4A585356
"""The first number of a file of vectors."""

ABI = 2
"""The version of the functions of controller_library.c and of the rows that they take."""


def vectors_file(vectors: Vectors) -> bytes:
    """Little-endian doubles: counts (magic, rows, numbers given, numbers expected), then rows."""
    counts = [MAGIC, len(vectors.given), vectors.given.shape[1], vectors.expected.shape[1]]
    head = np.array(counts, "<f8").tobytes()
    return head + np.concatenate([vectors.given, vectors.expected], axis=1).astype("<f8").tobytes()


def records_header(program: FlightProgram, intro: Sequence[str]) -> str:
    """controller_records.h: structures as rows of doubles, for tests and software in the loop."""
    sizes = {name: program.structs[name].size for name in ("input", "state", "output")}
    lines = [*intro, "#ifndef CONTROLLER_RECORDS_H", "#define CONTROLLER_RECORDS_H", ""]
    lines += ['#include "controller.h"', ""]
    lines += [f"#define CONTROLLER_{name.upper()}_SIZE ({size})" for name, size in sizes.items()]
    lines.append("")
    for name in ("input", "state"):
        lines += reader(program.structs[name])
    for name in ("state", "output"):
        lines += writer(program.structs[name])
    return "\n".join([*lines, "#endif /* CONTROLLER_RECORDS_H */", ""])


def reader(struct: Struct) -> list[str]:
    """The function that makes a structure of a row of doubles."""
    head = f"static inline void read_{struct.name}(const double *row, {struct.name} *x)"
    lines = [head, "{"]
    place = 0
    for field in struct.fields:
        kind, element = TYPES[field.dtype], _element(field)
        source = "row[{}] != 0.0" if field.dtype.kind == "b" else f"({kind})row[{{}}]"
        lines += _each(field, f"{element} = {source};", place)
        place += field.size
    if not struct.fields:
        lines.append("  (void)row; x->unused = 0;")
    return [*lines, "}", ""]


def writer(struct: Struct) -> list[str]:
    """The function that makes a row of doubles of a structure."""
    head = f"static inline void write_{struct.name}(const {struct.name} *x, double *row)"
    lines = [head, "{"]
    place = 0
    for field in struct.fields:
        value = (
            f"{_element(field)} ? 1.0 : 0.0"
            if field.dtype.kind == "b"
            else (f"(double){_element(field)}")
        )
        lines += _each(field, f"row[{{}}] = {value};", place)
        place += field.size
    if not struct.fields:
        lines.append("  (void)x; (void)row;")
    return [*lines, "}", ""]


def _element(field: Field) -> str:
    return f"x->{field.name}" + "".join(f"[{'ijkm'[n]}]" for n in range(len(field.shape)))


def _each(field: Field, statement: str, place: int) -> list[str]:
    lines, indent = [], "  "
    offset = ""
    for n, size in enumerate(field.shape):
        variable = "ijkm"[n]
        lines.append(f"{indent}for (int {variable} = 0; {variable} < {size}; {variable}++)")
        indent += "  "
        offset = f"({offset}) * {size} + {variable}" if offset else variable
    index = f"{place} + {offset}" if offset else str(place)
    return [*lines, indent + statement.format(index)]


def test_program(program: FlightProgram, intro: Sequence[str]) -> str:
    """The text of test_controller.c."""
    real, word, least = (
        ("float", "int32_t", "INT32_MIN") if program.single else ("double", "int64_t", "INT64_MIN")
    )
    text = template("test_controller.c", MAGIC=MAGIC, REAL=real, WORD=word, LEAST=least)
    return "\n".join([*intro, text])


def library_source(program: FlightProgram, intro: Sequence[str]) -> str:
    """The text of controller_library.c, which includes controller.c for its static stages.

    A row of parameters, inputs and state goes in for each case; the next state and the law's torque
    and mode (`control`), or what the law is told (`estimate`), come out. `controller_identity`
    returns ABI, program, precision and the SHA-256 of controller.h and controller.c, which the
    build files compute; `controller_defaults` writes the compiled parameters as a row.
    """
    structs = program.structs
    precision = "single" if program.single else "double"
    lines = [*intro, '#include "controller.c"', '#include "controller_records.h"', ""]
    lines += [*reader(structs["parameters"]), *writer(structs["parameters"])]
    if program.estimates:
        lines += [*reader(structs["seen"]), *writer(structs["seen"])]
    lines += [
        "#ifndef CONTROLLER_SHA256",
        '#error "build with make or CMake, which define CONTROLLER_SHA256"',
        "#endif",
        "",
        "const char *controller_identity(void);",
        "const char *controller_identity(void)",
        "{",
        f'  return "{ABI} {program.hash} {precision} " CONTROLLER_SHA256;',
        "}",
        "",
        "void controller_defaults(double *row);",
        "void controller_defaults(double *row)",
        "{",
        "  write_controller_parameters(&controller_default_parameters, row);",
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
    needs_clock = reads_clock(program.calls[stage])
    lines += ["    controller_clock clock;"] if needs_clock else []
    place = 0
    names = [("parameters", "parameters"), ("input", "input")]
    names += [("seen", "told")] if seen_in else []
    names += [("state", "before")]
    for (struct, variable), size in zip(names, sizes, strict=True):
        lines.append(f"    read_controller_{struct}(rows + {place}, &{variable});")
        place += size
    if uses_out:
        lines.append("    (void)memset(&output, 0, sizeof(output));")
    if needs_clock:
        lines.append("    clock.sample = input.sample;")
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
    arguments = {
        "p": "&parameters", "at": "&clock", "in": "&input", "seen": "&told", "now": "&before",
        "next": "&after", "out": "&output",
    }  # fmt: skip
    name, _, rest = call.partition("(")
    args = [arguments[arg] for arg in re.findall(r"\w+", rest)]
    return f"{name}({', '.join(args)});"
