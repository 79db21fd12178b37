"""controller_guard.c: measurements are judged, and the controller is called with valid ones."""

from collections.abc import Callable, Sequence

from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.flight.guard import (
    NORM_TOLERANCE,
    RATE_LIMIT,
    Group,
    groups,
    has_tracker,
    init_head,
    is_quaternion,
    is_rate,
    is_vector,
    real_type,
    step_head,
)
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template


def guard_source(
    program: FlightProgram, intro: Sequence[str], hold_samples: int = HOLD_SAMPLES
) -> str:
    """Return the text of controller_guard.c; `hold_samples` is the default of that limit."""
    lines = [*intro, '#include "controller_guard.h"', ""]
    lines += ["#include <math.h>", "#include <string.h>", ""]
    lines += ["const controller_guard_parameters controller_default_guard_parameters = {"]
    lines += [*default_limits(program, hold_samples), "};", ""]
    lines += [*_unit_quaternion(program), *_direction(program)]
    for group in groups(program):
        lines += _judge(program, group)
    lines += _check(program, "is_usable_output", "output", "isfinite({})")
    lines += _check(program, "is_usable_state", "state", "!isnan({})")
    lines += _zero_commands(program)
    lines += [*_begin(program), _step(program)]
    return "\n".join(lines)


def default_limits(program: FlightProgram, hold_samples: int) -> list[str]:
    """Return the default limits as lines of an initialiser of `controller_guard_parameters`."""
    suffix = "f" if program.single else ""
    return [
        f"  .hold_samples = {hold_samples},",
        f"  .rate_limit = {RATE_LIMIT}{suffix},",
        f"  .norm_tolerance = {NORM_TOLERANCE}{suffix},",
    ]


def _over(place: str, shape: tuple[int, ...], statement: Callable[[str], str]) -> list[str]:
    """Return a statement for each element of an array of this shape."""
    variables = "ijkm"[: len(shape)]
    lines = [
        f"{'  ' * depth}for (int32_t {variable} = 0; {variable} < {size}; {variable}++) {{"
        for depth, (variable, size) in enumerate(zip(variables, shape, strict=True), 1)
    ]
    depth = len(variables) + 1
    element = place + "".join(f"[{variable}]" for variable in variables)
    lines.append("  " * depth + statement(element))
    return lines + ["  " * inner + "}" for inner in range(depth - 1, 0, -1)]


def _floats(struct: Struct) -> list[Field]:
    return [field for field in struct.fields if field.dtype.kind == "f"]


AT_ONCE = 12
"""Number of fields that one function checks, so that its cyclomatic complexity is 13."""


def _arrays_usable(fields: Sequence[Field], name: str, real: str, condition: str) -> list[str]:
    """Return a function for each shape of array: whether all its numbers fulfil a condition."""
    lines: list[str] = []
    for shape in dict.fromkeys(field.shape for field in fields if field.shape):
        size = "x".join(map(str, shape))
        dimensions = "".join(f"[{n}]" for n in shape)
        lines += [f"static bool {name}_{size}(const {real} x{dimensions})", "{"]
        lines += ["  bool usable = true;", ""]
        lines += _over("x", shape, lambda x: f"usable = usable && ({condition.format(x)});")
        lines += ["  return usable;", "}", ""]
    return lines


def _check(program: FlightProgram, name: str, part: str, condition: str) -> list[str]:
    """Return a function that checks whether all floats of a structure fulfil a condition."""
    struct = program.structs[part]
    fields = _floats(struct)
    lines = _arrays_usable(fields, f"{name}_array", real_type(program), condition)
    groups = [fields[i : i + AT_ONCE] for i in range(0, len(fields), AT_ONCE)]
    calls = [f"{name}_{number}(x)" for number in range(1, len(groups) + 1)]
    for number, group in enumerate(groups, 1):
        begin = f"static bool {name}_{number}" if len(groups) > 1 else f"static bool {name}"
        lines += [f"{begin}(const {struct.name} *x)", "{", "  bool usable = true;", ""]
        for field in group:
            size = "x".join(map(str, field.shape))
            element = f"x->{field.name}"
            text = f"{name}_array_{size}({element})" if size else f"({condition.format(element)})"
            lines.append(f"  usable = usable && {text};")
        lines += ["  return usable;", "}", ""]
    if len(groups) == 1:
        return lines
    lines += [f"static bool {name}(const {struct.name} *x)", "{"]
    lines += ["  (void)x;"] * (not groups)
    lines.append(f"  return {' && '.join(calls) or 'true'};")
    return [*lines, "}", ""]


def _zero_commands(program: FlightProgram) -> list[str]:
    lines = ["static void set_zero(controller_output *x)", "{"]
    zero = "0.0f" if program.single else "0.0"
    for field in _floats(program.structs["output"]):
        lines += _over(f"x->{field.name}", field.shape, lambda x: f"{x} = {zero};")
    return [*lines, "}", ""]


def _unit_quaternion(program: FlightProgram) -> list[str]:
    quaternions = (is_quaternion(field) for group in groups(program) for field in group.fields)
    if not program.estimates and not any(quaternions):
        return []
    real, suffix = real_type(program), "f" if program.single else ""
    return [
        f"static bool is_unit(const {real} q[4], {real} tolerance)",
        "{",
        f"  const {real} square = (q[0] * q[0]) + (q[1] * q[1]) + (q[2] * q[2]) + (q[3] * q[3]);",
        "",
        f"  return fabs{suffix}(square - 1.0{suffix}) <= tolerance; /* false if not a number */",
        "}",
        "",
    ]


def _direction(program: FlightProgram) -> list[str]:
    """Return the function that checks a measured vector, for a program that has one."""
    if not any(is_vector(field) for group in groups(program) for field in group.fields):
        return []
    real, zero = real_type(program), "0.0f" if program.single else "0.0"
    return [
        f"static bool has_direction(const {real} x[3])",
        "{",
        f"  const {real} square = (x[0] * x[0]) + (x[1] * x[1]) + (x[2] * x[2]);",
        "",
        f"  return (square > {zero}) && isfinite(square);",
        "}",
        "",
    ]


def _judge(program: FlightProgram, group: Group) -> list[str]:
    """Return the function that checks whether a measurement is valid in itself."""
    suffix = "f" if program.single else ""
    lines = [
        f"static bool is_valid_{group.name}(const controller_input *x,",
        f"{' ' * len(f'static bool is_valid_{group.name}(')}"
        "const controller_guard_parameters *limits)",
        "{",
        "  bool valid = true;",
        "",
    ]
    for field in group.fields:
        place = f"x->{field.name}"
        if is_quaternion(field):
            lines.append(f"  valid = valid && is_unit({place}, limits->norm_tolerance);")
            continue
        if is_vector(field):
            lines.append(f"  valid = valid && has_direction({place});")
            continue
        # false for what is not a number
        rate = f"fabs{suffix}({{}}) <= limits->rate_limit"
        condition = rate if is_rate(field) else "isfinite({})"
        lines += _over(
            place, field.shape, lambda x, text=condition: f"valid = valid && ({text.format(x)});"
        )
    if "limits" not in "\n".join(lines[3:]):
        lines.append("  (void)limits;")
    return [*lines, "  return valid;", "}", ""]


def _begin(program: FlightProgram) -> list[str]:
    lines = [init_head(program), "{", "  (void)memset(guard, 0, sizeof(*guard));"]
    if program.estimates:
        lines.append("  (void)memcpy(guard->attitude, attitude, sizeof(guard->attitude));")
    return [*lines, "}", ""]


def _step(program: FlightProgram) -> str:
    """Return the guarded step, after its helper functions."""
    estimates, every = program.estimates, groups(program)
    judgements = [
        f"  if ({f'in->{group.seen} && ' if group.seen else ''}"
        f"!(valid->{group.name} && is_valid_{group.name}(in, limits))) {{\n"
        f"    status |= {group.bit};\n  }}"
        for group in every
    ]
    init = "controller_init(p, &checked, &after);"
    begins = "steps = has_begun(p, limits, guard, &checked, &after);"
    substitute = "  substitute(in, valid, limits, status, guard, &checked);\n"
    coast = "  if (!steps && guard->begun && !repeated) {\n    coast(p, &checked, guard);\n  }\n"
    return template(
        "guard_step.c",
        JUDGEMENTS="\n".join(judgements),
        ESTIMATOR=_estimator(program) * estimates,
        HEAD="\n".join(step_head("")),
        VITAL=" | ".join(group.bit for group in every if group.seen is None),
        SUBSTITUTE=substitute * estimates,
        BEGIN=begins if estimates else init,
        COAST=coast * estimates,
    )


MEASURED_ATTITUDE = """\
  if (!is_unit(guard->attitude, limits->norm_tolerance) && checked->seen) {
    (void)memcpy(guard->attitude, checked->attitude, sizeof(guard->attitude));
  }
"""


def _estimator(program: FlightProgram) -> str:
    """Return the functions of the guard of an estimator."""
    return template(
        "guard_estimator.c",
        MISSING="\n".join(_missing(program, group) for group in groups(program) if group.seen),
        MEASURED=MEASURED_ATTITUDE * has_tracker(program),
    )


def _missing(program: FlightProgram, group: Group) -> str:
    """Return the statement that makes an invalid measurement one that is missing."""
    lines = [f"  if (!is_valid_{group.name}(in, limits) || !valid->{group.name}) {{"]
    lines.append(f"    checked->{group.seen} = false; /* as in an outage of the sensor */")
    one, zero = ("1.0f", "0.0f") if program.single else ("1.0", "0.0")
    for field in group.fields:
        place = f"checked->{field.name}"
        if is_vector(field):
            numbers = enumerate((one, zero, zero))
            lines += [f"    {place}[{i}] = {number};" for i, number in numbers]
        else:
            lines.append(f"    (void)memcpy({place}, guard->attitude, sizeof(guard->attitude));")
    return "\n".join([*lines, "  }"])
