"""controller_guard_step of controller_guard.c, in functions that a reviewer can read."""

from jaxsat.flight.guard import groups, step_head
from jaxsat.flight.program import FlightProgram


def step_functions(program: FlightProgram) -> list[str]:
    """The step behind the guard, after the functions that it is made of."""
    estimates = program.estimates
    vital = [group.bit for group in groups(program) if not (estimates and group.name == "attitude")]
    lines = [*_judged(program), *_counted(), *_finished()]
    lines += [*_substitutes(), *_began(), *_coast()] if estimates else []
    lines += [
        *step_head(""),
        "{",
        "  controller_input checked = *in;",
        "  controller_state after = guard->state;",
        "  uint32_t status = judged(in, valid, limits) | counted(in, guard);",
        "  const bool repeated = (status & CONTROLLER_STATUS_REPEATED) != 0u;",
        f"  bool steps = !repeated && ((status & ({' | '.join(vital)})) == 0u);",
        "",
    ]
    if estimates:
        lines.append("  substitute(in, valid, limits, status, guard, &checked);")
    lines += [
        "  if (!guard->begun && steps) {",
        f"    {_BEGINS if estimates else 'controller_init(p, &checked, &after);'}",
        "  }",
        "  if (steps) {",
        "    controller_step(p, &checked, &after, out);",
        "    steps = is_usable_output(out) && is_usable_state(&after);",
        "    status |= steps ? 0u : CONTROLLER_STATUS_REJECTED;",
        "  }",
    ]
    if estimates:
        lines += [
            "  if (!steps && guard->begun && !repeated) {",
            "    coast(p, &checked, guard);",
            "  }",
        ]
    return [*lines, "  return status | finished(limits, steps, &after, guard, out);", "}", ""]


def _judged(program: FlightProgram) -> list[str]:
    """What is said of the measurements."""
    lines = [
        "static uint32_t judged(const controller_input *in, const controller_validity *valid,",
        "                       const controller_guard_parameters *limits)",
        "{",
        "  uint32_t status = 0u;",
        "",
    ]
    for group in groups(program):
        condition = "in->seen && " if program.estimates and group.name == "attitude" else ""
        lines += [
            f"  if ({condition}!(valid->{group.name} && is_valid_{group.name}(in, limits))) {{",
            f"    status |= {group.bit};",
            "  }",
        ]
    return [*lines, "  return status;", "}", ""]


def _counted() -> list[str]:
    """The number of the sample against that of the last one."""
    return [
        "static uint32_t counted(const controller_input *in, controller_guard *guard)",
        "{",
        "  const uint32_t passed = (uint32_t)in->sample - (uint32_t)guard->sample;",
        "  const bool repeated = guard->called && ((passed == 0u) || (passed > 0x7FFFFFFFu));",
        "  uint32_t status = 0u;",
        "",
        "  if (repeated) {",
        "    status = CONTROLLER_STATUS_REPEATED;",
        "  } else {",
        "    if (guard->called && (passed > 1u)) {",
        "      status = CONTROLLER_STATUS_SKIPPED;",
        "    }",
        "    guard->sample = in->sample;",
        "    guard->called = true;",
        "  }",
        "  return status;",
        "}",
        "",
    ]


_BEGINS = "steps = has_begun(p, limits, guard, &checked, &after);"


def _began() -> list[str]:
    """The controller begins at the first valid sample."""
    return [
        "static bool has_begun(const controller_parameters *p,",
        "                      const controller_guard_parameters *limits, controller_guard *guard,",
        "                      const controller_input *checked, controller_state *after)",
        "{",
        "  bool begins;",
        "",
        "  if (!is_unit(guard->attitude, limits->norm_tolerance) && checked->seen) {",
        "    (void)memcpy(guard->attitude, checked->attitude, sizeof(guard->attitude));",
        "  }",
        "  begins = is_unit(guard->attitude, limits->norm_tolerance);",
        "  if (begins) {",
        "    controller_init(p, guard->attitude, checked, after);",
        "  }",
        "  return begins;",
        "}",
        "",
    ]


def _coast() -> list[str]:
    """The estimator alone."""
    return [
        "static void coast(const controller_parameters *p, const controller_input *checked,",
        "                  controller_guard *guard)",
        "{",
        "  controller_state after = guard->state;",
        "",
        "  controller_coast(p, checked, &after);",
        "  if (is_usable_state(&after)) {",
        "    guard->state = after;",
        "  }",
        "}",
        "",
    ]


def _finished() -> list[str]:
    """State, commands and status after a step, or without one."""
    return [
        "static uint32_t finished(const controller_guard_parameters *limits, bool steps,",
        "                         const controller_state *after, controller_guard *guard,",
        "                         controller_output *out)",
        "{",
        "  uint32_t status = 0u;",
        "",
        "  if (steps) {",
        "    guard->begun = true;",
        "    guard->state = *after;",
        "    guard->last = *out;",
        "    guard->missed = 0;",
        "  } else {",
        "    guard->without_step++;",
        "    if (guard->begun && (guard->missed < limits->hold_samples)) {",
        "      guard->missed++;",
        "      status = CONTROLLER_STATUS_HELD;",
        "    } else {",
        "      set_zero(&guard->last);",
        "      status = CONTROLLER_STATUS_ZERO;",
        "    }",
        "    *out = guard->last;",
        "  }",
        "  return status;",
        "}",
        "",
    ]


def _substitutes() -> list[str]:
    """What an estimator is given in the place of invalid measurements."""
    return [
        "static void substitute(const controller_input *in, const controller_validity *valid,",
        "                       const controller_guard_parameters *limits, uint32_t status,",
        "                       controller_guard *guard, controller_input *checked)",
        "{",
        "  if ((status & CONTROLLER_STATUS_INVALID_RATE) != 0u) {",
        "    (void)memcpy(checked->rate, guard->rate, sizeof(guard->rate));",
        "  } else {",
        "    (void)memcpy(guard->rate, in->rate, sizeof(guard->rate));",
        "  }",
        "  if (!is_valid_attitude(in, limits) || !valid->attitude) {",
        "    checked->seen = false; /* as in an outage of the star tracker */",
        "    (void)memcpy(checked->attitude, guard->attitude, sizeof(guard->attitude));",
        "  }",
        "}",
        "",
    ]
