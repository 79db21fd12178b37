"""Declaration and application of rules across keys."""

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.core import declaration
from jaxsat.core.declaration.laws import LAWS, Law
from jaxsat.core.errors import foreign_exceptions
from jaxsat.scenario.control import is_plugin, known_law
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.plugins import place_in
from jaxsat.scenario.wording import shown

Values = Mapping[str, Any]
"""Scenario values by dotted key."""

Check = Callable[..., Iterator[Issue]]


@dataclass(frozen=True)
class ScenarioRule:
    """A check and the dotted keys that it requires."""

    keys: tuple[str, ...]
    check: Callable[[Values], Iterable[Issue]]


RULES: list[ScenarioRule] = []

OF_THE_LAW = (
    "control.",
    "sampling.",
    "dispersion",
    "tuning.",
    "settled.",
    "simulation.attitude",
    "simulation.coordinates",
    "simulation.solver.",
)
"""Prefixes of the keys that do not affect the motion without a control law."""


def rule(*keys: str) -> Callable[[Check], Check]:
    """Register a check that takes the values of `keys` in this order.

    The value of `control.law` is the `Law`, here and in `rule_over`.
    """

    def register(check: Check) -> Check:
        RULES.append(ScenarioRule(keys, lambda values: check(*(values[key] for key in keys))))
        return check

    return register


def rule_over(*keys: str) -> Callable[[Check], Check]:
    """Register a check that takes all values, and requires those of `keys`."""

    def register(check: Check) -> Check:
        RULES.append(ScenarioRule(keys, check))
        return check

    return register


def broken_rules(values: Values, law: bool = True) -> list[Issue]:
    """Issues from every rule whose keys all have valid values; rules on the law only with `law`."""
    issues: list[Issue] = []
    declared_law = known_law(values.get("control.law"))
    if declared_law is not None:
        values = {**values, "control.law": declared_law}
    for entry in (*RULES, *(() if declared_law is None else _rules_of(declared_law))):
        applies = law or not any(key.startswith(OF_THE_LAW) for key in entry.keys)
        if applies and all(key in values for key in entry.keys):
            involved = tuple(tuple(key.split(".")) for key in entry.keys)
            for issue in entry.check(values):
                issues.append(Issue(issue.location, issue.message, involved, issue.missing))
    return issues


def _rules_of(law: Law) -> Iterator[ScenarioRule]:
    for law_rule in law.declaration.rules:
        yield declared_rule(law_rule, law)
    for low, high in law.declaration.ordered:
        keys = (f"control.{low}", f"control.{high}")
        yield ScenarioRule(keys, functools.partial(_in_order, low, high))


def declared_rule(rule: declaration.Rule, law: Law | None = None) -> ScenarioRule:
    """A declared rule of a part or a law as a rule of a scenario; the check gets the law's name."""
    keys = rule.keys

    def check(values: Values) -> list[Issue]:
        try:
            arguments = (str(values[key]) if key == "control.law" else values[key] for key in keys)
            return [at(*one) for one in rule.check(*arguments)]
        except foreign_exceptions() as error:
            if law is None or not is_plugin(law.name):
                raise
            place = place_in(inspect.getfile(law.controller), error)
            message = f"must name a law whose rule over {', '.join(keys)} can run"
            return [at("control.law", f"{message}, got {type(error).__name__}: {error}{place}")]

    return ScenarioRule(keys, check)


def _in_order(low: str, high: str, values: Values) -> Iterator[Issue]:
    one, other = values[f"control.{low}"], values[f"control.{high}"]
    if None not in (one, other) and one > other:
        yield at(f"control.{low}", f"must not exceed {high} = {shown(other)}, got {shown(one)}")


ROUNDING = 1e-9
"""Tolerance on a whole multiple, relative to the time, and at most 1e-7 of the divisor."""


def is_multiple(whole: float, part: float) -> bool:
    """Whether `whole` is an integer multiple of `part`, up to round-off."""
    count = round(whole / part)
    return count >= 1 and abs(count * part - whole) <= min(ROUNDING * whole, 1e-7 * part)


STEPS = ("simulation.solver.steps", "simulation.solver.step_s")
"""Keys that distinguish adaptive from fixed steps."""


def key_of_fixed_steps(values: Values) -> str | None:
    """The key of `STEPS` that gives a continuous law fixed steps; None for other steps."""
    steps, step = (values[key] for key in STEPS)
    if values["control.law"].declaration.sampled or steps == "adaptive":
        return None
    return STEPS[0] if steps == "fixed" else None if step is None else STEPS[1]


def sampled_laws() -> str:
    """Names of jaxsat's sampled laws, for a message."""
    return ", ".join(f'"{name}"' for name, one in LAWS.items() if one.declaration.sampled)


def at(key: str, message: str, missing: bool = False) -> Issue:
    """Return an issue at a dotted key; the tables of an array have numbers from 0."""
    location = tuple(int(part) if part.isdecimal() else part for part in key.split("."))
    return Issue(location, message, (), missing)


def outage_mistakes(
    values: Mapping[str, float | None], prefix: str = ""
) -> Iterator[tuple[str, str, bool]]:
    """Yield name, message, and whether the key is absent, for each mistake.

    Names of keys in `values` begin with `prefix`.
    """
    start, length, every = (f"{prefix}outage{end}" for end in ("_start_s", "_s", "_every_s"))
    for one, other in ((start, length), (length, start)):
        if values[one] is None and values[other] is not None:
            yield one, f"must be given with {other}, got nothing", True
    period, duration = values[every], values[length]
    if period is None:
        return
    if duration is None:
        yield every, f"must be left out without {length}, got {shown(period)}", False
    elif period <= duration:
        message = f"must be above {length} = {shown(duration)}, got {shown(period)}"
        yield every, message, False
