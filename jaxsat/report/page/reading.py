"""Reads the files of a folder of results; an unreadable or changed file becomes one message."""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from jaxsat.store import OutputError
from jaxsat.store.files import parse_json
from jaxsat.store.marker import read_unchanged


def read_record(path: Path) -> Mapping[str, Any]:
    """The JSON object that a file holds; raises `OutputError`."""
    found = parse_json(read_unchanged(path))
    if not isinstance(found, Mapping):
        raise OutputError(f"{path} is damaged, or was not written by jaxsat.")
    return found


def read_lines(path: Path) -> str:
    """The text of a file, empty where there never was one; raises `OutputError`."""
    return (read_unchanged(path) or b"").decode(errors="replace")


@contextlib.contextmanager
def form_explained(folder: Path) -> Iterator[None]:
    """Turns what missing numbers lead to into an `OutputError` that names the folder."""
    try:
        yield
    except (KeyError, IndexError, TypeError, AttributeError, ValueError) as error:
        raise OutputError(f"{folder} contains numbers of another form; write it again.") from error
