"""Code around the controller: records, test program, and controller_library.c for many cases."""

import re
from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.flight.calls import call_sizes
from jaxsat.flight.guard import real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import reads_clock
from jaxsat.flight.templates import template
from jaxsat.flight.vectors import Vectors

MAGIC, MAGIC_OF_CALLS = 0x4A585356, 0x4A585343
"""First numbers of a file of vectors, and of one of calls."""

ABI = 2
"""Version of the functions of controller_library.c and of their rows."""


def vectors_file(vectors: Vectors, magic: int = MAGIC) -> bytes:
    """Return little-endian doubles: counts (magic, rows, given, expected numbers), then rows."""
    counts = [magic, len(vectors.given), vectors.given.shape[1], vectors.expected.shape[1]]
    head = np.array(counts, "<f8").tobytes()
    return head + np.concatenate([vectors.given, vectors.expected], axis=1).astype("<f8").tobytes()


def records_header(program: FlightProgram, intro: Sequence[str]) -> str:
    """Return controller_records.h: structures as rows of doubles, for tests and the library."""
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
    """Return the function that converts a row of doubles to a structure."""
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
    """Return the function that converts a structure to a row of doubles."""
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
    """Return the text of test_controller.c."""
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
    """Return controller_library.c, which includes controller.c for its static stages.

    Input is a row of parameters, inputs and state for each case; output the next state, and the
    law's torque and mode (`control`) or the law's input (`estimate`). `controller_identity` returns
    ABI, program, precision and the SHA-256 of controller.h and controller.c, which the build files
    compute; `controller_defaults` writes the compiled parameters as a row.
    """
    rows = ("parameters", *("seen",) * program.estimates)
    records = [one(program.structs[name]) for name in rows for one in (reader, writer)]
    stages = ("estimate",) * program.estimates + ("control",)
    text = template(
        "controller_library.c",
        RECORDS="\n".join(line for lines in records for line in lines),
        ABI=ABI,
        PROGRAM=program.hash,
        PRECISION="single" if program.single else "double",
        STAGES="\n".join(_batch(program, one) for one in stages).removesuffix("\n"),
    )
    return "\n".join([*intro, text])


def _batch(program: FlightProgram, stage: str) -> str:
    """Return the functions of a stage for many cases; the law reads the estimator's output."""
    variables = {"parameters": "parameters", "input": "input", "seen": "told", "state": "before"}
    estimates = stage == "estimate"
    if estimates or not program.estimates:
        del variables["seen"]
    reads, place = [], 0
    for name, variable in variables.items():
        reads.append(f"read_controller_{name}(rows + {place}, &{variable});")
        place += program.structs[name].size
    declarations = [("output", "output")] * (not estimates) + [("seen", "told")] * program.estimates
    if not estimates:
        reads.append("(void)memset(&output, 0, sizeof(output));")
    if reads_clock(program.calls[stage]):
        declarations.append(("clock", "clock"))
        reads.append("clock.sample = input.sample;")
    kind, result = ("seen", "told") if estimates else ("output", "output")
    size = program.structs[kind].size
    return template(
        "batch.c",
        STAGE=stage,
        VARIABLES="".join(f"    controller_{one} {variable};\n" for one, variable in declarations),
        READS="".join(f"    {read}\n" for read in reads),
        CALL=_call(program, stage),
        KIND=kind,
        RESULT=result,
        STATE=size,
        ROW=place,
        NEXT=size + program.structs["state"].size,
    )


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
    """Return controller_calls.h: a call of an entry point by a row of doubles, for tests."""
    sizes, real = call_sizes(program), real_type(program)
    ends = accumulate(sizes.values())
    places = {name: end - size for end, (name, size) in zip(ends, sizes.items(), strict=True)}
    attitude = f"  for (int i = 0; i < 4; i++)\n    attitude[i] = ({real})row[{{}} + i];\n"
    coast = "  } else {\n    controller_coast(&p, &in, &state);\n"
    text = template(
        "controller_calls.h",
        SIZE=sum(sizes.values()),
        REAL=real,
        PARAMETERS=sizes["parameters"],
        READER="\n".join(reader(program.structs["parameters"])),
        VARIABLE=f"  {real} attitude[4];\n" * program.estimates,
        AT_PARAMETERS=places["parameters"],
        READ_ATTITUDE=attitude.format(places["attitude"]) * program.estimates,
        AT_INPUT=places["input"],
        AT_STATE=places["state"],
        WHETHER="if (row[0] == 1.0) " * program.estimates,
        ATTITUDE="attitude, " * program.estimates,
        COAST=coast * program.estimates,
    )
    return "\n".join([*intro, text])
