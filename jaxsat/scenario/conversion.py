"""A scenario's data on their way to the keys that it is checked by, and where each came from."""

import copy
import dataclasses
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from jaxsat.scenario.errors import Issue, Location


class Conversion(NamedTuple):
    """The data so far, what was wrong with them, and for each new place that in the file."""

    data: dict[str, Any]
    issues: list[Issue]
    places: dict[Location, Location]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Conversion":
        """The data before anything is converted, a copy."""
        return cls(copy.deepcopy(dict(data)), [], {})

    def replace(self, location: Location, old: str, new: str, value: Any) -> None:
        """Put a value under a new key of a table in place of an old key."""
        table: Any = self.data
        for part in location:
            table = table[part]
        del table[old]
        table[new] = value
        self.places[(*location, new)] = (*location, old)

    def as_written(self, issue: Issue) -> Issue:
        """An issue about the keys that the user wrote."""
        location = self._user_location(issue.location)
        involved = tuple(map(self._user_location, issue.involved))
        message, converted = self._with_own_keys(issue), self._converted(issue.location)
        if converted and converted[-1] not in location:
            message = f"{message} (read as {converted[-1]})"
        return dataclasses.replace(issue, location=location, involved=involved, message=message)

    def _with_own_keys(self, issue: Issue) -> str:
        """The message, in which each key that the user wrote otherwise is named as in the file.

        A key without its table belongs to one of the tables that the issue is about.
        """
        tables = {_dotted(one[:-1]) for one in (issue.location, *issue.involved)}
        own = {_dotted(new): str(old[-1]) for new, old in self.places.items()}

        def named(match: re.Match[str]) -> str:
            table, key = match[1], match[2]
            places = [table] if table else [f"{one}." for one in tables]
            place = next((one for one in places if one + key in own), None)
            if place is None:
                return match[0]
            written = own[place + key]
            while place + written in own:
                written = own[place + written]
            return f"{table}{written} (read as {key})"

        return re.sub(r"\b((?:\w+\.)*)(\w+)\b", named, issue.message)

    def _converted(self, location: Location) -> Location:
        """The beginning of a location that is none in the file; nothing if it is one."""
        ends = range(len(location), 0, -1)
        return next((location[:end] for end in ends if location[:end] in self.places), ())

    def _user_location(self, location: Location) -> Location:
        converted = self._converted(location)
        if not converted:
            return location
        return self._user_location((*self.places[converted], *location[len(converted) :]))


def _dotted(location: Location) -> str:
    """Names of tables and keys; entries of arrays are alike."""
    return ".".join(part for part in location if isinstance(part, str))
