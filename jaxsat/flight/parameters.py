"""controller_parameters.h and .c, bounds of all parameters and a checksum; the same of a plan."""

import zlib
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from jaxsat.compiler.c.expressions import literal
from jaxsat.compiler.c.layout import Struct, fields_of
from jaxsat.compiler.c.naming import Names, comment
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.text import csv_text
from jaxsat.flight.flight import as_type
from jaxsat.flight.guard import NORM_TOLERANCE, real_type
from jaxsat.flight.interface import PLAN, Parameter
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import initialisers
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


def plan_table(law: AbstractSampledController, *, single: bool) -> list[Parameter]:
    """Return the fields of a law's plan with its numbers; empty for a law without a plan."""
    if not law.plan_keys:
        return []
    plan = as_type(cast(Any, law).plan, np.float32 if single else np.float64)
    keys = {key.name: key for key in law.plan_keys}
    fields = fields_of(plan, Names(fields=True))
    return [Parameter(one, np.asarray(plan[one.number]), keys.get(one.path)) for one in fields]


def plan_code(
    program: FlightProgram, plan: Sequence[Parameter], intro: Sequence[str]
) -> dict[str, str]:
    """Return controller_plan.h and .c, by which a plan is uploaded; none for a law without one."""
    if not plan:
        return {}
    struct = Struct("controller_plan", "A plan.", tuple(one.field for one in plan))
    header = template("controller_plan.h", STRUCTURE="\n".join(struct.declaration()))
    places = {one.path.removeprefix(PLAN): one.name for one in program.structs["parameters"].fields}
    copies = [_copy(one, places[one.field.path]) for one in plan]
    upload = template(
        "controller_plan.c",
        REAL=real_type(program),
        TOLERANCE=f"{NORM_TOLERANCE:g}" + "f" * program.single,
        COUNT=struct.fields[2].shape[0],
        COPIES="\n".join(copies),
    )
    table = table_source(program, plan, intro, struct.name)
    return {
        "controller_plan.h": "\n".join([*intro, header]),
        "controller_plan.c": "\n".join([table, upload]),
    }


def _copy(one: Parameter, place: str) -> str:
    """Return the C statement that copies a field of a plan to its place in the parameters."""
    name = one.field.name
    if not one.field.shape:
        return f"    p->{place} = plan->{name};"
    return f"    (void)memcpy(p->{place}, plan->{name}, sizeof(p->{place}));"


def plan_files(plan: Sequence[Parameter], intro: Sequence[str]) -> dict[str, str]:
    """Return plan.h, the plan as an initialiser of C, and plan.csv; none without a plan."""
    if not plan:
        return {}
    number = f"{checksum(plan):08X}"
    values = {one.field.number: one.default for one in plan}
    lines = initialisers([one.field for one in plan], [values[i] for i in range(len(values))], {})
    text = template("plan.h", CHECKSUM=number, NUMBERS="\n".join(lines))
    rows = [
        (*place, "" if one.key is None else one.key.unit, repr(float(x)))
        for one in plan
        for place, x in zip(_places(one), one.default.ravel(), strict=True)
    ]
    head = ("field", "element", "unit", "value")
    table = csv_text([head, *rows, ("checksum", "", "", f"0x{number}")])
    return {"plan.h": "\n".join([*intro, text]), "plan.csv": table}


def _places(one: Parameter) -> list[tuple[str, str]]:
    """Return the name of a field, and the index of each element."""
    return [(one.field.name, " ".join(map(str, index))) for index in np.ndindex(one.field.shape)]
