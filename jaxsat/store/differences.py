"""Where two nests of plain data differ, for messages."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

SHOWN = 6
"""Differences between two studies that are told."""

PROGRAM = "program"
"""What of an identity a scenario does not name, or names better."""

NUMBERS = "numbers"
"""What of a program has no names; told where nothing with a name differs."""

OPERATIONS = "operations"
"""What of a program is a hash of its traced operations, told where nothing else explains it."""

OTHER_PROGRAM = "the program differs, as after a change of the law, of another part or of a library"


def differences(old: Any, new: Any) -> list[str]:
    """Where two nests of plain data differ, one clause for each place; of many the first few."""
    places = sorted(
        _differences(old, new), key=lambda place: (place[0][:1] == (PROGRAM,), place[0])
    )
    named = [place for place in places if not _is_operations(place[0])]
    named = [place for place in named if not _is_number(place[0])] or named
    clauses = [f"{'.'.join(path)}: {_short(x)} there, {_short(y)} here" for path, x, y in named]
    if places and not named:
        clauses = [OTHER_PROGRAM]
    more = len(clauses) - SHOWN
    return [*clauses[:SHOWN], f"and {more} more"] if more > 0 else clauses


def _is_operations(path: tuple[str, ...]) -> bool:
    return path[0] == PROGRAM and path[-1] == OPERATIONS


def _is_number(path: tuple[str, ...]) -> bool:
    return path[0] == PROGRAM and NUMBERS in path[1:]


def _differences(old: Any, new: Any, *path: str) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Path, old and new value of every place where they differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in sorted(set(old) | set(new)):
            yield from _differences(old.get(key), new.get(key), *path, key)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (x, y) in enumerate(zip(old, new, strict=True), 1):
            yield from _differences(x, y, *path, str(number))
    elif old != new and (old == old or new == new):  # NaN is NaN
        yield path, old, new


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "…"
