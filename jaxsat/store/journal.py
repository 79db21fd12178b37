"""A file that grows line by line, each line with a checksum of its own."""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from jaxsat.store.files import content_hash, parse_json, read_file, write_file

_APPEND = os.O_WRONLY | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


class JournalEntries(NamedTuple):
    """What a journal holds, in the order of writing, and how many of its lines cannot be read."""

    good: list[dict[str, Any]]
    damaged: int


class Journal:
    """Plain data, appended entry by entry to a file; `tag` tells journals apart.

    A line is a hash and JSON, so that a line that was changed, or that another journal's replaces,
    is known. What the system refuses raises `OSError`, and then the file is what it was.
    """

    def __init__(self, path: Path, tag: str = ""):
        self.path = path
        self._tag = tag

    def write(self, entries: Iterable[dict[str, Any]]) -> None:
        """Begin with these entries, in place of what there is."""
        write_file(self.path, self.content(entries))

    def content(self, entries: Iterable[dict[str, Any]]) -> bytes:
        """The file of a journal with these entries."""
        return b"".join(map(self._line, entries))

    def append(self, entry: dict[str, Any], *, durable: bool = True) -> None:
        """One more entry; `durable` waits until it is on the disk."""
        line = self._line(entry)
        handle = os.open(self.path, _APPEND)
        try:
            size = os.fstat(handle).st_size
            try:
                while line:  # on a full disk a part may be taken before the rest is refused
                    line = line[os.write(handle, line) :]
                if durable:
                    os.fsync(handle)
            except OSError:
                os.ftruncate(handle, size)
                raise
        finally:
            os.close(handle)

    def read(self) -> JournalEntries | None:
        """All entries; None where there is no such file."""
        content = read_file(self.path)
        if content is None:
            return None
        lines = content.split(b"\n")
        torn = int(bool(lines.pop()))  # the last line ends like every other one
        found = [self._entry(line) for line in lines]
        good = [entry for entry in found if entry is not None]
        return JournalEntries(good, len(found) - len(good) + torn)

    def _line(self, entry: dict[str, Any]) -> bytes:
        text = json.dumps(entry, sort_keys=True, separators=(",", ":"))
        return f"{self._hash(text.encode())} {text}\n".encode()

    def _hash(self, text: bytes) -> str:
        return content_hash(text, self._tag)

    def _entry(self, line: bytes) -> dict[str, Any] | None:
        check, _, text = line.partition(b" ")
        if check != self._hash(text).encode():
            return None
        entry = parse_json(text)
        return entry if isinstance(entry, dict) else None
