"""`[[requirement]]`: requirements on a run, as formulas over its signals."""

from typing import Annotated, Any

from pydantic import AfterValidator

from jaxsat.core.declaration.requirements import (
    REQUIRED_SIGNALS,
    Formula,
    Temporal,
    all_parts,
    comparisons,
)
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.formulas import parse
from jaxsat.scenario.quantities import Line, ScenarioTable, Text, choice
from jaxsat.scenario.rules import rule, rule_over
from jaxsat.scenario.wording import shown

_WITH_THEM = tuple(dict.fromkeys(one.actuator for one in REQUIRED_SIGNALS.values() if one.actuator))


def _known_formula(text: str) -> str:
    parse(text)
    return text


class RequirementTable(ScenarioTable):
    """`[[requirement]]`: a requirement on a run."""

    id: Line = choice("Its name in tables, such as that in a specification")
    text: Text = choice("What it says, as a sentence", "")
    formula: Annotated[Line, AfterValidator(_known_formula)] = choice(
        'What must hold and when, such as "always[300 s, end] pointing_error < 2 deg"'
    )

    @property
    def parsed(self) -> Formula:
        """The parsed formula."""
        return parse(self.formula)


@rule("requirement")
def _ids_differ(requirements):
    ids = [one.id for one in requirements]
    for number, name in enumerate(ids):
        if name in ids[:number]:
            message = f"must differ from that of requirement {ids.index(name) + 1}"
            yield Issue(("requirement", number, "id"), f"{message}, got {shown(name)}")


@rule_over("requirement", *_WITH_THEM)
def _signals_are_told(values):
    for number, one in enumerate(values["requirement"]):
        for part in comparisons(one.parsed):
            actuator = REQUIRED_SIGNALS[part.signal].actuator
            if actuator and not values[actuator]:
                message = f"must name signals of a spacecraft without [[{actuator}]]"
                got = f"{part.signal} at column {part.column}"
                yield Issue(("requirement", number, "formula"), f"{message}, got {got}")


@rule("requirement", "failure", "simulation.duration_s")
def _windows_begin_in_the_run(requirements, failures, duration):
    for number, one in enumerate(requirements):
        for part in all_parts(one.parsed):
            if not isinstance(part, Temporal):
                continue
            message = _window_obstacle(part, failures, duration)
            if message:
                yield Issue(("requirement", number, "formula"), message)


def _window_obstacle(part: Temporal, failures: Any, duration: float) -> str:
    """Reason why the window of an operator is invalid; empty if it is valid."""
    if part.after_failure and not failures:
        return f"must have a [[failure]] to count from, got {part.kind} with failure"
    begin, end = (
        one.offset + (duration if one.anchor == "end" else 0.0) for one in (part.begin, part.end)
    )
    limit = f"simulation.duration_s = {shown(duration)}"
    if part.begin.anchor == "start" and begin > duration:
        return f"must have windows that begin by {limit}, got {begin:g} s"
    if part.end.anchor == "start" and end > duration:
        return f"must have windows that end by {limit}, got {end:g} s"
    for one, at in ((part.begin, begin), (part.end, end)):
        if at < 0 and one.anchor != "start":
            rule = "within the run" if one.anchor == "end" else "at the failure or after it"
            return f"must have windows {rule}, got {one.anchor} - {-one.offset:g} s"
    if not part.after_failure and begin > end:
        return f"must have windows that end after they begin, got {begin:g} s to {end:g} s"
    return ""
