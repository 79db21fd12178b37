"""Errors and warnings about scenarios, with their locations."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from jaxsat.core.errors import JaxsatError
from jaxsat.core.text import clean

Location = tuple[str | int, ...]
"""Location of a value: table and key names, then positions from 0 inside an array."""

MAX_LISTED = 20
"""Largest number of problems in the text of a `ScenarioError`."""

MAX_PLACE_LENGTH, MAX_MESSAGE_LENGTH = 200, 2000
"""Largest number of characters of a source or a key, and of a message."""


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
    """An issue for the user: the file (or the option), the line and the key."""

    source: str
    message: str
    key: str | None = None
    line: int | None = None

    def __str__(self) -> str:
        """Return `file:line: key table.key: must …`, on one line that is safe to print."""
        source = clean(self.source, MAX_PLACE_LENGTH)
        place = source if self.line is None else f"{source}:{self.line}"
        key = "" if self.key is None else f"key {clean(self.key, MAX_PLACE_LENGTH)}: "
        return f"{place}: {key}{clean(self.message, MAX_MESSAGE_LENGTH)}"


class ScenarioError(JaxsatError):
    """A scenario that cannot be used; `problems` holds every problem of the scenario.

    The text lists the first problems, one on a line.
    """

    problems: tuple[Problem, ...]

    def __init__(self, problems: Iterable[Problem]):
        self.problems = tuple(problems)
        lines = [str(problem) for problem in self.problems[:MAX_LISTED]]
        more = len(self.problems) - len(lines)
        if more:
            source = clean(self.problems[0].source, MAX_PLACE_LENGTH)
            lines.append(f"{source}: and {more} more mistake{'s' if more > 1 else ''}")
        super().__init__("\n".join(lines))


class MissingTable(JaxsatError, ValueError):
    """A scenario without a required table; the text is "[table] must be given, …"."""

    def __init__(self, table: str):
        super().__init__(f"[{table}] must be given, got nothing")


class ScenarioWarning(UserWarning):
    """A scenario that is valid but likely a mistake."""


def key_of(location: Location) -> str | None:
    """Dotted key of a location, without positions inside arrays; None for the whole file."""
    names = [part for part in location if isinstance(part, str)]
    return ".".join(names) if names else None


def entry_of(location: Location) -> str:
    """Position inside the value of a key as a clause, " as entry 2 of row 1" (from 1), or empty;
    the line number identifies the table in an array of tables."""
    key = max((place for place, part in enumerate(location) if isinstance(part, str)), default=-1)
    positions = [part + 1 for part in location[key + 1 :] if isinstance(part, int)]
    if not positions:
        return ""
    row = f" of row {positions[-2]}" if len(positions) > 1 else ""
    return f" as entry {positions[-1]}{row}"
