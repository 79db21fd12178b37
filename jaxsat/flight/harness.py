"""What stands around the controller: records of numbers, the test program, and
controller_library.c, its stages for many cases at once, for software in the loop."""

import re
from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.compiler.c.naming import comment
from jaxsat.flight.calls import call_sizes
from jaxsat.flight.guard import real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import reads_clock
from jaxsat.flight.templates import template
from jaxsat.flight.vectors import Vectors

MAGIC, MAGIC_OF_CALLS = 0x4A585356, 0x4A585343
"""The first number of a file of vectors, and of one of calls."""

ABI = 2
"""The version of the functions of controller_library.c and of the rows that they take."""


def vectors_file(vectors: Vectors, magic: int = MAGIC) -> bytes:
    """Little-endian doubles: counts (magic, rows, numbers given, numbers expected), then rows."""
    counts = [magic, len(vectors.given), vectors.given.shape[1], vectors.expected.shape[1]]
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
    text = template(
        "test_controller.c",
        MAGIC=MAGIC,
        MAGIC_OF_CALLS=MAGIC_OF_CALLS,
        REAL=real,
        WORD=word,
        LEAST=least,
    )
    return "\n".join([*intro, text])


def library_source(program: FlightProgram, intro: Sequence[str]) -> str:
    """The text of controller_library.c, which includes controller.c for its static stages.

    A row of parameters, inputs and state goes in for each case; the next state and the law's torque
    and mode (`control`), or what the law is given (`estimate`), come out. `controller_identity`
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


def calls_header(program: FlightProgram, intro: Sequence[str]) -> str:
    """controller_calls.h: a call of an entry point by a row of doubles, for tests."""
    sizes, place = call_sizes(program), 0
    real = real_type(program)
    lines = [*intro, "#ifndef CONTROLLER_CALLS_H", "#define CONTROLLER_CALLS_H", ""]
    lines += ['#include "controller_records.h"', "", "#include <string.h>", ""]
    lines += [f"#define CALL_SIZE ({sum(sizes.values())})", f"#define CALL_REAL {real}"]
    lines += [f"#define CALL_PARAMETERS ({sizes['parameters']})", ""]
    lines += reader(program.structs["parameters"])
    lines += comment(
        "Calls what the first number of the row tells: 0 controller_step, 1 controller_init, "
        "2 controller_coast. found gets the outputs (zero where there are none), then the state."
    )
    lines += [
        "static inline void make_call(const double *row, double *found)",
        "{",
        "  controller_parameters p;",
        "  controller_input in;",
        "  controller_state state;",
        "  controller_output out;",
    ]
    reads = []
    for name, size in sizes.items():
        if name in ("parameters", "input", "state"):
            variable = {"parameters": "p", "input": "in", "state": "state"}[name]
            reads.append(f"  read_controller_{name}(row + {place}, &{variable});")
        elif name == "attitude" and size:
            lines.append(f"  {real} attitude[4];")
            reads.append("  for (int i = 0; i < 4; i++)")
            reads.append(f"    attitude[i] = ({real})row[{place} + i];")
        place += size
    lines += ["", "  (void)memset(&out, 0, sizeof(out));", *reads]
    attitude = "attitude, " * program.estimates
    lines += ["  if (row[0] == 0.0) {", "    controller_step(&p, &in, &state, &out);"]
    lines += ["  } else if (row[0] == 1.0) {"] if program.estimates else ["  } else {"]
    lines += [f"    controller_init(&p, {attitude}&in, &state);"]
    if program.estimates:
        lines += ["  } else {", "    controller_coast(&p, &in, &state);"]
    lines += ["  }", "  write_controller_output(&out, found);"]
    lines += ["  write_controller_state(&state, found + CONTROLLER_OUTPUT_SIZE);", "}", ""]
    return "\n".join([*lines, "#endif /* CONTROLLER_CALLS_H */", ""])
