"""prove_controller.c: calls of the controller with any numbers, for a proof of no run-time error.

`make prove` has Frama-C's Eva analyse them. Eva takes variables outside of functions for any values
of their types, infinities and numbers that are none included.
"""

from collections.abc import Sequence

from jaxsat.flight.guard import groups, real_type
from jaxsat.flight.program import FlightProgram


def prove_source(program: FlightProgram, intro: Sequence[str]) -> str:
    """The text of prove_controller.c."""
    attitude = "attitude, " * program.estimates
    lines = [*intro, '#include "controller_guard.h"', '#include "controller_parameters.h"', ""]
    for name in ("parameters", "input", "state", "output"):
        lines.append(f"static controller_{name} {_VARIABLES[name]};")
    if program.estimates:
        lines.append(f"static {real_type(program)} attitude[4];")
    lines += [
        "static controller_guard_parameters limits;",
        "static controller_validity valid;",
        "static controller_guard guard;",
        "static volatile int choice; /* any number whenever it is read */",
        "",
        "static void any_input(void);",
        "static void any_input(void)",
        "{",
        *_flags(program, "input"),
        *(f"  valid.{group.name} = choice != 0;" for group in groups(program)),
        "}",
        "",
        "int main(void);",
        "int main(void)",
        "{",
        "  any_input();",
        *_flags(program, "parameters"),
        *_flags(program, "state"),
        *_flags(program, "output"),
        "  switch (choice) {",
        "  case 0:",
        f"    controller_init(&p, {attitude}&in, &state);",
        "    break;",
    ]
    if program.estimates:
        lines += ["  case 1:", "    controller_coast(&p, &in, &state);", "    break;"]
    lines += [
        "  case 2:",
        "    guard.state = state;",
        "    guard.last = out;",
        "    guard.called = choice != 0;",
        "    guard.begun = choice != 0;",
        "    (void)controller_guard_step(&p, &limits, &in, &valid, &guard, &out);",
        "    break;",
        "  case 3:",
        f"    controller_guard_init({attitude}&guard);",
        "    break;",
        "  case 4:",
        "    (void)controller_check_parameters(&p);",
        "    (void)controller_parameter_checksum(&p);",
        "    break;",
        "  default:",
        "    controller_step(&p, &in, &state, &out);",
        "    break;",
        "  }",
        "  return 0;",
        "}",
        "",
    ]
    return "\n".join(lines)


_VARIABLES = {"parameters": "p", "input": "in", "state": "state", "output": "out"}


def _flags(program: FlightProgram, struct: str) -> list[str]:
    """Statements that make each truth value of a structure true or false, and no other byte."""
    fields = (one for one in program.structs[struct].fields if one.dtype.kind == "b")
    return [
        f"  {text} = choice != 0;"
        for one in fields
        for text in one.elements(f"{_VARIABLES[struct]}.")
    ]
