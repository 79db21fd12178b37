"""What a design found, for a person: the page that is written and printed."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from jaxsat.core.numerals import number_text, vector_text
from jaxsat.core.text import clean, markdown
from jaxsat.store.design_text import (
    ASSUMPTIONS,
    DESIGNED,
    IN_COMMON,
    LAWS_NOT_FITTING,
    REMEDIES,
    REMEDIES_NOTE,
    UNSETTLED_CASES,
    tuning_text,
)
from jaxsat.studies import Interval, ends_text, fraction_text
from jaxsat.synthesis.comparison import ComparisonRow
from jaxsat.synthesis.controller_design.explanation import Remedy
from jaxsat.synthesis.controller_design.result import ControllerDesign, Step, Verification

SHOWN_CASES = 20
"""Failing cases that are listed; design.json has all."""


def headline(found: ControllerDesign) -> str:
    """The verdict in one sentence or two."""
    verification, wanted = found.verification, f"{100 * found.settings.settled:.8g}"
    if verification is None or found.chosen is None:
        why = "No law of jaxsat fits what is left."
        if found.settings.law != "all":
            why = f"The law {found.settings.law} does not fit the vehicle."
        return f"Nothing to design. {why}"
    fraction = verification.settled
    first = (
        f"{found.chosen.name} settles {fraction_text(fraction)} of "
        f"{verification.summary.cases} unseen cases; wanted were {wanted} %"
    )
    if found.proven:
        return f"Reached: {first}. The whole interval is above."
    if found.outcome == "reached":
        return f"Reached: {first}. So many cases do not prove it: the interval begins below."
    unsure = (
        "" if fraction.high < found.settings.settled else ", which the interval does not exclude"
    )
    return f"Not reached: {first}{unsure}."


def design_page(found: ControllerDesign) -> str:
    """Markdown: verdict, what is left, choice of the law, verification, and what would help."""
    blocks = [f"# Design: {markdown(found.original.title)}", f"**{headline(found)}**"]
    if found.misses_attitude:
        blocks.append(f"**{found.misses_attitude}**")
    blocks += ["## What is left", _items(found.verdict.lines())]
    if found.assumed:
        blocks += [f"## {ASSUMPTIONS}", _items(found.assumed)]
    if found.left_out:
        blocks += [f"## {LAWS_NOT_FITTING}", _items(found.left_out)]
    if found.cautions:
        blocks += ["## Beyond what the laws are verified on", _items(found.cautions)]
    if found.screening is not None:
        blocks += ["## Choice of the law", *_choice(found)]
    if found.verification is not None:
        blocks += ["## Verification", *_verification(found, found.verification)]
    return "\n\n".join(blocks) + "\n"


def design_comment(found: ControllerDesign, version: str) -> str:
    """Lines for the head of the designed scenario: where it comes from and what it is proven on."""
    verification = found.verification
    assert verification is not None
    lines = [
        f"Designed by jaxsat {version} for: {found.original.title}",
        *[f"  {line}" for line in found.verdict.lines()],
        headline(found),
        f"Verification: seed {found.settings.seeds.verification}, by "
        f"`jaxsat montecarlo {DESIGNED} --seed {found.settings.seeds.verification} "
        f"-n {found.settings.cases}`.",
    ]
    if found.assumed:
        lines += [f"{ASSUMPTIONS}:"]
        lines += [f"  {line}" for line in found.assumed]
    if found.misses_attitude is not None:
        lines.append(found.misses_attitude)
    elif found.settings.attitude == "nearest" and not found.verdict.holds:
        lines.append(
            "Body axes are turned so that the nearest attitude that can be held is the target."
        )
    if not found.gains:
        lines.append("The gains are functions of inertia, torque limit and control period.")
    return "".join(f"# {line}\n" for line in lines)


def _choice(found: ControllerDesign) -> Iterator[str]:
    assert found.screening is not None
    assert found.chosen is not None
    seeds = found.settings.seeds
    yield f"Screening, seed {seeds.screening}:"
    yield from _step(found.screening)
    tuning = found.tuning_data()
    if tuning is not None:
        yield tuning_text(tuning)
    if found.validation is not None:
        yield f"Validation, seed {seeds.validation}:"
        yield from _step(found.validation)
    gains = ", ".join(f"{key} = {_gain(value)}" for key, value in found.gains.items())
    yield f"Chosen: **{found.chosen.name}**{f' with {gains}' if gains else ''}."


def _step(step: Step) -> Iterator[str]:
    head = ["law", "cases", "settled", "t50 (s)", "t90 (s)", "effort (N m s)", "peak rate (rad/s)"]
    yield _table(head, [_cells(row) for row in step.rows])
    reason = step.verdict.reason
    taken = step.verdict.law or "none"
    yield f"Best: {taken}. {reason[0].upper()}{reason[1:]}."


def _cells(row: ComparisonRow) -> list[str]:
    return [
        row.setting.law,
        str(row.cases),
        fraction_text(row.settled),
        _seconds(row.t50),
        _seconds(row.t90),
        number_text(row.effort),
        number_text(row.peak_rate, 3),
    ]


def _verification(found: ControllerDesign, made: Verification) -> Iterator[str]:
    summary, seed = made.summary, found.settings.seeds.verification
    outcomes = ", ".join(f"{count} {name}" for name, count in summary.outcomes.items())
    rows = [["cases", f"{summary.cases}: {outcomes}"], ["settled", fraction_text(made.settled)]]
    for name, unit in _TOLD:
        for percent, entry in getattr(summary, name).items():
            label = f"{name.replace('_', ' ')}, {percent:g} % ({unit})"
            rows.append([label, f"{number_text(entry.value)} ({ends_text(entry)})"])
    yield (
        _table([f"seed {seed}, used for nothing before", "found"], rows)
        + "\n\n"
        + ("Intervals are of 95 %.")
    )
    if not made.failing:
        return
    yield f"## {UNSETTLED_CASES}"
    listed = ", ".join(map(str, made.failing[:SHOWN_CASES]))
    more = len(made.failing) - SHOWN_CASES
    yield (
        f"{listed}{f' and {more} more (design.json has all)' if more > 0 else ''}. Each alone, "
        f"with figures: `jaxsat montecarlo {DESIGNED} --seed {seed} --case {made.failing[0]}`."
    )
    if found.outcome == "reached":
        return
    yield f"### {IN_COMMON}"
    if made.separations:
        head = ["number", "share explained", "failing: 10, 50, 90 %", "settled: 10, 50, 90 %"]
        yield _table(
            head,
            [
                [one.name, f"{one.share:.2f}", _three(one.failing), _three(one.settled)]
                for one in made.separations
            ],
        )
    else:
        yield "No drawn number separates them from the others by more than chance."
    yield f"### {REMEDIES}"
    if made.limit is not None:
        yield f"**What limits it: with {made.limit.change} {_helped(made.limit)} settle.**"
        yield from _cause(found, made.limit.change)
    yield REMEDIES_NOTE
    yield _table(
        ["change", "settle then"],
        [[one.change, f"{_helped(one)} ({one.settled / one.flown:.0%})"] for one in made.remedies],
    )


def _helped(remedy: Remedy) -> str:
    return f"{remedy.settled} of {remedy.flown}"


def _cause(found: ControllerDesign, change: str) -> Iterator[str]:
    """Why it is so, where more is known than the number."""
    if "error of the axes" in change and found.original.thruster:
        yield (
            "Every thruster leans by an angle of its own, so the torques of one that pushes and "
            "of its opposite leave the plane by different amounts: about the axis without a torque "
            "there is one that goes with the size of the command, which no law here knows. "
            "Measure the axes, or give the thrusters that are used less error."
        )


def _items(lines: Sequence[str]) -> str:
    return "\n".join(f"- {clean(line)}" for line in lines)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


_TOLD = (("settling_time", "s, of those that settle"), ("effort", "N m s"), ("propellant", "kg"))


def _seconds(value: Interval) -> str:
    if not np.isfinite(value.value):
        return "never"
    return f"{number_text(value.value)} ({ends_text(value)})"


def _gain(value: Any) -> str:
    if isinstance(value, tuple):
        return vector_text(value)
    return number_text(value)


def _three(values: tuple[float, float, float]) -> str:
    return ", ".join(number_text(one, 3) for one in values)
