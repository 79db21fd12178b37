"""How rules across keys are declared and applied."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from jaxsat.scenario.coordinates import Values
from jaxsat.scenario.errors import Issue

Check = Callable[..., Iterator[Issue]]


@dataclass(frozen=True)
class Rule:
    """A check and the dotted keys without which it is not applied."""

    keys: tuple[str, ...]
    check: Callable[[Values], Iterator[Issue]]


RULES: list[Rule] = []

OF_THE_LAW = (
    "control.",
    "sampling.",
    "dispersion",
    "tuning.",
    "simulation.attitude",
    "simulation.coordinates",
    "simulation.solver.",
)
"""What the keys begin with that the motion without a control law does not depend on."""


def rule(*keys: str) -> Callable[[Check], Check]:
    """Register a check that takes the values of `keys` in this order."""

    def register(check: Check) -> Check:
        RULES.append(Rule(keys, lambda values: check(*(values[key] for key in keys))))
        return check

    return register


def rule_over(*keys: str) -> Callable[[Check], Check]:
    """Register a check that takes all values, and needs those of `keys`."""

    def register(check: Check) -> Check:
        RULES.append(Rule(keys, check))
        return check

    return register


def broken_rules(values: Values, law: bool = True) -> list[Issue]:
    """Issues from every rule whose keys all have valid values; without those on the law if told."""
    found: list[Issue] = []
    for entry in RULES:
        wanted = law or not any(key.startswith(OF_THE_LAW) for key in entry.keys)
        if wanted and all(key in values for key in entry.keys):
            involved = tuple(tuple(key.split(".")) for key in entry.keys)
            for issue in entry.check(values):
                found.append(Issue(issue.location, issue.message, involved, issue.missing))
    return found


def at(key: str, message: str, missing: bool = False) -> Issue:
    """An issue at a dotted key."""
    return Issue(tuple(key.split(".")), message, (), missing)
