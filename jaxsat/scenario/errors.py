"""What can be wrong with a scenario, and where."""

from collections.abc import Iterable
from dataclasses import dataclass, field

Location = tuple[str | int, ...]
"""Where a value is: table and key names, then positions from 0 inside an array."""


@dataclass(frozen=True)
class Issue:
    """A rule that a value breaks: `message` is "must …, got …".

    `involved` are the other keys that take part in the rule.
    """

    location: Location
    message: str
    involved: tuple[Location, ...] = ()
    missing: bool = field(default=False)


@dataclass(frozen=True)
class Problem:
    """An issue as a person is told it: the file (or the option), the line and the key."""

    source: str
    message: str
    key: str | None = None
    line: int | None = None

    def __str__(self) -> str:
        """`file:line: key table.key: must …`."""
        place = self.source if self.line is None else f"{self.source}:{self.line}"
        key = "" if self.key is None else f"key {self.key}: "
        return f"{place}: {key}{self.message}"


class ScenarioError(Exception):
    """A scenario that cannot be used; `problems` holds everything that is wrong with it."""

    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]):
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class ScenarioWarning(UserWarning):
    """Something about a scenario that is allowed and yet is likely a mistake."""


def key_of(location: Location) -> str | None:
    """The dotted key of a location, without positions inside arrays; None for the whole file."""
    names = [part for part in location if isinstance(part, str)]
    return ".".join(names) if names else None


def entry_of(location: Location) -> str:
    """The position inside an array as a clause, " as entry 2 of row 1" (from 1), or nothing."""
    positions = [part + 1 for part in location if isinstance(part, int)]
    if not positions:
        return ""
    row = f" of row {positions[-2]}" if len(positions) > 1 else ""
    return f" as entry {positions[-1]}{row}"
