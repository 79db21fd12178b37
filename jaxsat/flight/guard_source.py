"""controller_guard.c: measurements are judged, and the controller is called with valid ones."""

from collections.abc import Callable, Sequence

from jaxsat.compiler.c.layout import Field, Struct
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.flight.guard import (
    NORM_TOLERANCE,
    RATE_LIMIT,
    Group,
    groups,
    init_head,
    is_quaternion,
    is_rate,
    real_type,
    step_head,
)
from jaxsat.flight.program import FlightProgram


def guard_source(
    program: FlightProgram, intro: Sequence[str], hold_samples: int = HOLD_SAMPLES
) -> str:
    """The text of controller_guard.c; `hold_samples` is the default of that limit."""
    lines = [*intro, '#include "controller_guard.h"', ""]
    lines += ["#include <math.h>", "#include <string.h>", ""]
    lines += ["const controller_guard_parameters controller_default_guard_parameters = {"]
    lines += [*default_limits(program, hold_samples), "};", ""]
    lines += _unit_quaternion(program)
    for group in groups(program):
        lines += _judge(program, group)
    lines += _check("is_usable_output", program.structs["output"], "isfinite({})")
    lines += _check("is_usable_state", program.structs["state"], "!isnan({})")
    lines += _zero_commands(program)
    lines += _begin(program) + _step(program)
    return "\n".join(lines)


def default_limits(program: FlightProgram, hold_samples: int) -> list[str]:
    """The default limits as lines of an initialiser of `controller_guard_parameters`."""
    suffix = "f" if program.single else ""
    return [
        f"  .hold_samples = {hold_samples},",
        f"  .rate_limit = {RATE_LIMIT}{suffix},",
        f"  .norm_tolerance = {NORM_TOLERANCE}{suffix},",
    ]


def _over(field: Field, statement: Callable[[str], str]) -> list[str]:
    """A statement for each element of a field of `x`."""
    variables = "ijkm"[: len(field.shape)]
    lines = [
        f"{'  ' * depth}for (int32_t {variable} = 0; {variable} < {size}; {variable}++) {{"
        for depth, (variable, size) in enumerate(zip(variables, field.shape, strict=True), 1)
    ]
    depth = len(variables) + 1
    element = f"x->{field.name}" + "".join(f"[{variable}]" for variable in variables)
    lines.append("  " * depth + statement(element))
    return lines + ["  " * inner + "}" for inner in range(depth - 1, 0, -1)]


def _floats(struct: Struct) -> list[Field]:
    return [field for field in struct.fields if field.dtype.kind == "f"]


def _check(name: str, struct: Struct, condition: str) -> list[str]:
    """A function that tells whether all floats of a structure fulfil a condition."""
    lines = [f"static bool {name}(const {struct.name} *x)", "{", "  bool usable = true;", ""]
    for field in _floats(struct):
        lines += _over(field, lambda x: f"usable = usable && ({condition.format(x)});")
    lines += ["  (void)x;"] * (not _floats(struct))
    return [*lines, "  return usable;", "}", ""]


def _zero_commands(program: FlightProgram) -> list[str]:
    lines = ["static void set_zero(controller_output *x)", "{"]
    zero = "0.0f" if program.single else "0.0"
    for field in _floats(program.structs["output"]):
        lines += _over(field, lambda x: f"{x} = {zero};")
    return [*lines, "}", ""]


def _unit_quaternion(program: FlightProgram) -> list[str]:
    if not any(is_quaternion(field) for group in groups(program) for field in group.fields):
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


def _judge(program: FlightProgram, group: Group) -> list[str]:
    """The function that tells whether a measurement is valid in itself."""
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
        if is_quaternion(field):
            lines.append(f"  valid = valid && is_unit(x->{field.name}, limits->norm_tolerance);")
        elif is_rate(field):  # false for what is not a number
            condition = f"fabs{suffix}({{}}) <= limits->rate_limit"
            lines += _over(field, lambda x, text=condition: f"valid = valid && ({text.format(x)});")
        else:
            lines += _over(field, lambda x: f"valid = valid && (isfinite({x}));")
    if "limits" not in "\n".join(lines[3:]):
        lines.append("  (void)limits;")
    return [*lines, "  return valid;", "}", ""]


def _begin(program: FlightProgram) -> list[str]:
    lines = [init_head(program), "{", "  (void)memset(guard, 0, sizeof(*guard));"]
    if program.estimates:
        lines.append("  (void)memcpy(guard->attitude, attitude, sizeof(guard->attitude));")
    return [*lines, "}", ""]


def _step(program: FlightProgram) -> list[str]:
    estimates = program.estimates
    lines = [
        *step_head(""),
        "{",
        "  controller_input checked = *in;",
        "  controller_state after = guard->state;",
        "  const uint32_t passed = (uint32_t)in->sample - (uint32_t)guard->sample;",
        "  const bool repeated = guard->called && ((passed == 0u) || (passed > 0x7FFFFFFFu));",
        "  uint32_t status = 0u;",
        "  bool steps;",
        "",
    ]
    vital = []
    for group in groups(program):
        may_be_missing = estimates and group.name == "attitude"
        seen = "in->seen && " if may_be_missing else ""
        vital += [] if may_be_missing else [group.bit]
        lines += [
            f"  if ({seen}!(valid->{group.name} && is_valid_{group.name}(in, limits))) {{",
            f"    status |= {group.bit};",
            "  }",
        ]
    lines += [f"  steps = !repeated && ((status & ({' | '.join(vital)})) == 0u);"]
    lines += _substitutes() if estimates else []
    return [*lines, *_count(), *_first(estimates), *_controller_step(estimates), *_finish()]


def _count() -> list[str]:
    """The number of the sample against that of the last one."""
    return [
        "  if (repeated) {",
        "    status |= CONTROLLER_STATUS_REPEATED;",
        "  } else {",
        "    if (guard->called && (passed > 1u)) {",
        "      status |= CONTROLLER_STATUS_SKIPPED;",
        "    }",
        "    guard->sample = in->sample;",
        "    guard->called = true;",
        "  }",
    ]


def _first(estimates: bool) -> list[str]:
    """The controller begins at the first valid sample."""
    if not estimates:
        begin = ["    controller_init(p, &checked, &after);"]
    else:
        begin = [
            "    if (!is_unit(guard->attitude, limits->norm_tolerance) && checked.seen) {",
            "      (void)memcpy(guard->attitude, checked.attitude, sizeof(guard->attitude));",
            "    }",
            "    steps = is_unit(guard->attitude, limits->norm_tolerance);",
            "    if (steps) {",
            "      controller_init(p, guard->attitude, &checked, &after);",
            "    }",
        ]
    return ["  if (!guard->begun && steps) {", *begin, "  }"]


def _controller_step(estimates: bool) -> list[str]:
    """The step of the controller, or of its estimator alone."""
    lines = [
        "  if (steps) {",
        "    controller_step(p, &checked, &after, out);",
        "    steps = is_usable_output(out) && is_usable_state(&after);",
        "    status |= steps ? 0u : CONTROLLER_STATUS_REJECTED;",
        "  }",
    ]
    if estimates:
        lines += [
            "  if (!steps && guard->begun && !repeated) {",
            "    after = guard->state;",
            "    controller_coast(p, &checked, &after);",
            "    if (is_usable_state(&after)) {",
            "      guard->state = after;",
            "    }",
            "  }",
        ]
    return lines


def _finish() -> list[str]:
    """State, commands and status after a step, or without one."""
    return [
        "  if (steps) {",
        "    guard->begun = true;",
        "    guard->state = after;",
        "    guard->last = *out;",
        "    guard->missed = 0;",
        "  } else {",
        "    guard->without_step++;",
        "    if (guard->begun && (guard->missed < limits->hold_samples)) {",
        "      guard->missed++;",
        "      status |= CONTROLLER_STATUS_HELD;",
        "    } else {",
        "      set_zero(&guard->last);",
        "      status |= CONTROLLER_STATUS_ZERO;",
        "    }",
        "    *out = guard->last;",
        "  }",
        "  return status;",
        "}",
        "",
    ]


def _substitutes() -> list[str]:
    """What an estimator is told in the place of invalid measurements."""
    return [
        "  if ((status & CONTROLLER_STATUS_INVALID_RATE) != 0u) {",
        "    (void)memcpy(checked.rate, guard->rate, sizeof(guard->rate));",
        "  } else {",
        "    (void)memcpy(guard->rate, in->rate, sizeof(guard->rate));",
        "  }",
        "  if (!is_valid_attitude(in, limits) || !valid->attitude) {",
        "    checked.seen = false; /* as in an outage of the star tracker */",
        "    (void)memcpy(checked.attitude, guard->attitude, sizeof(guard->attitude));",
        "  }",
    ]
