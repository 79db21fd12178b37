"""controller_parameters.h and .c: bounds of all parameters, and the checksum of a table."""

import zlib
from collections.abc import Sequence

import numpy as np

from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.naming import comment
from jaxsat.flight.guard import real_type
from jaxsat.flight.interface import Parameter
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template


def checksum(of_parameters: Sequence[Parameter]) -> int:
    """CRC-32/ISO-HDLC of the defaults: elements in order as little-endian bytes, no padding."""
    values = (one.default.astype(one.field.dtype.newbyteorder("<")) for one in of_parameters)
    return zlib.crc32(b"".join(value.tobytes() for value in values))


def parameters_header(of_parameters: Sequence[Parameter], intro: Sequence[str]) -> str:
    """The text of controller_parameters.h."""
    lines = [*intro, "#ifndef CONTROLLER_PARAMETERS_H", "#define CONTROLLER_PARAMETERS_H", ""]
    lines += ['#include "controller.h"', ""]
    lines += comment("controller_parameter_checksum of the scenario's numbers.")
    lines += [f"#define CONTROLLER_DEFAULT_CHECKSUM (0x{checksum(of_parameters):08X}u)", ""]
    lines += comment(
        "The number of the first parameter, counted from 1 in the order of the structure, that has "
        "an element out of range or not a number; 0 if there is none. controller_parameters.c has "
        "the ranges."
    )
    lines += ["int32_t controller_check_parameters(const controller_parameters *p);", ""]
    lines += comment(
        "CRC-32/ISO-HDLC (reversed polynomial 0xEDB88320, begin and final exclusive or 0xFFFFFFFF) "
        "of all elements in order, as little-endian bytes without padding."
    )
    lines += ["uint32_t controller_parameter_checksum(const controller_parameters *p);", ""]
    return "\n".join([*lines, "#endif /* CONTROLLER_PARAMETERS_H */", ""])


def parameters_source(
    program: FlightProgram, of_parameters: Sequence[Parameter], intro: Sequence[str]
) -> str:
    """The text of controller_parameters.c."""
    real = real_type(program)
    lines = [*intro, '#include "controller_parameters.h"', ""]
    lines += ["#include <math.h>", "#include <stddef.h>", "#include <string.h>", ""]
    lines += [f"#define PARAMETERS ({len(of_parameters)})", ""]
    lines += ["typedef enum { FREE, NUMBER, TRUTH } parameter_kind;", ""]
    lines += ["typedef struct {", "  size_t offset;", "  uint32_t count;", "  uint32_t size;"]
    lines += [
        "  parameter_kind kind;",
        f"  {real} least;",
        f"  {real} most;",
        "} parameter_row;",
        "",
    ]
    lines += ["static const parameter_row rows[] = {"]
    zero = np.zeros((), np.float32 if program.single else np.float64)[()]
    for number, one in enumerate(of_parameters, 1):
        field, (least, most) = one.field, one.bounds or (zero, zero)
        unit = "" if one.key is None or one.key.unit == "1" else f" {one.key.unit}"
        lines += comment(f"{number} {field.path}: {one.range}{unit}", "  ")
        lines.append(
            f"  {{offsetof(controller_parameters, {field.name}), {field.size}u, "
            f"{field.dtype.itemsize}u,"
        )
        free = "TRUTH" if field.dtype.kind == "b" else "FREE"
        kind = free if one.bounds is None else "NUMBER"
        lines.append(f"   {kind}, {literal(least).text}, {literal(most).text}}},")
    if not of_parameters:
        lines.append("  {0u, 0u, 0u, FREE, 0, 0},")
    return "\n".join([*lines, "};", template("controller_parameters.c", REAL=real)])
