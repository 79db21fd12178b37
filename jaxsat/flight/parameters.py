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
    """Return CRC-32/ISO-HDLC of the defaults in order, as little-endian bytes without padding."""
    values = (one.default.astype(one.field.dtype.newbyteorder("<")) for one in of_parameters)
    return zlib.crc32(b"".join(value.tobytes() for value in values))


def parameters_header(of_parameters: Sequence[Parameter], intro: Sequence[str]) -> str:
    """Return the text of controller_parameters.h."""
    number = f"{checksum(of_parameters):08X}"
    return "\n".join([*intro, template("controller_parameters.h", CHECKSUM=number)])


def parameters_source(
    program: FlightProgram, of_parameters: Sequence[Parameter], intro: Sequence[str]
) -> str:
    """Return the text of controller_parameters.c."""
    return table_source(program, of_parameters, intro, "controller_parameters")


def table_source(
    program: FlightProgram, of_parameters: Sequence[Parameter], intro: Sequence[str], table: str
) -> str:
    """Return the text of the range check and the checksum of a structure, a `table`."""
    real, plain = real_type(program), table.removeprefix("controller_")
    lines: list[str] = []
    for number, one in enumerate(of_parameters, 1):
        field = one.field
        unit = "" if one.key is None or one.key.unit == "1" else f" {one.key.unit}"
        lines += comment(f"{number} {field.path}: {one.range}{unit}", "  ")
        lines.append(
            f"  {{offsetof({table}, {field.name}), {field.size}u, {field.dtype.itemsize}u,"
        )
        lines.append(f"   {_limits(one)}}},")
    if not of_parameters:
        lines.append("  {0u, 0u, 0u, FREE, 0, 0, 0, 0},")
    text = template(
        "controller_parameters.c",
        REAL=real,
        COUNT=len(of_parameters),
        ROWS="\n".join(lines),
        TABLE=table,
        KIND=f"{plain.removesuffix('s')}_kind",
        ROW=f"{plain.removesuffix('s')}_row",
        CHECK=f"controller_check_{plain}",
        CHECKSUM=f"controller_{plain.removesuffix('s')}_checksum",
    )
    return "\n".join([*intro, text])


def _limits(one: Parameter) -> str:
    """Return the kind of a parameter and its bounds, of floats and of whole numbers."""
    if one.field.dtype.kind == "b":
        return "TRUTH, 0, 0, 0, 0"
    if one.bounds is None:
        return "FREE, 0, 0, 0, 0"
    if one.field.dtype.kind == "i":
        return "WHOLE, 0, 0, " + ", ".join(literal(np.int64(x)).text for x in one.bounds)
    return f"NUMBER, {', '.join(literal(x).text for x in one.bounds)}, 0, 0"
