"""Markers, by which jaxsat recognises its own folders and files.

The marker of a folder is one document, replaced whole. It records a file's hash before the file is
written, and one name for all files during writing. So even the remains of a killed process can be
distinguished from a user's files, and only files unchanged since jaxsat wrote them are ever
replaced or removed.
"""

import json
import os
import stat
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jaxsat.store.files import (
    OutputError,
    content_hash,
    explained,
    new_token,
    parse_json,
    partial_name,
    read_file,
    read_or_explain,
    write_file,
)
from jaxsat.store.system_files import is_of_system, user_files_in, walk

MARKER = ".jaxsat"
"""File that marks a folder as written by jaxsat."""

FORMAT = 2

EARLIER = b'"written_by"'
"""Text in markers of format 1 and in no later one; files beside one are read unverified."""


NameTest = Callable[[str], bool]
"""Whether a file or folder of this name is built from jaxsat's files."""


def nothing(name: str) -> bool:
    """Return false: no name is that of a build product."""
    return False


class Marker:
    """Content of a folder, and the hashes of all files written to it.

    `kind` is the type of the result, such as "run"; `about` is plain data kept with it; `complete`
    marks a finished folder. `partial` is the name of files during writing.
    """

    folder: Path
    kind: str
    about: Mapping[str, Any]
    complete: bool

    def __init__(
        self,
        folder: Path,
        kind: str,
        about: Mapping[str, Any],
        partial: str,
        *,
        complete: bool = False,
        hashes: Mapping[str, list[str]] | None = None,
    ):
        self.folder, self.kind, self.about = folder, kind, dict(about)
        self.complete = complete
        self._partial = folder / partial
        self._hashes = {name: list(several) for name, several in (hashes or {}).items()}

    @staticmethod
    def make(folder: Path, kind: str, about: Mapping[str, Any]) -> "Marker":
        """Make the marker of a folder that this process has just made; raises `OSError`."""
        marker = Marker(folder, kind, about, partial_name(new_token()))
        marker._save()
        return marker

    @staticmethod
    def read(folder: Path) -> "Marker | None":
        """Return the marker of a folder, None without a readable one; raises `OSError`."""
        document = parse_json(read_file(folder / MARKER))
        try:
            check, form = document.pop("check"), document.pop("format")
            if check != _check({"format": form, **document}) or form != FORMAT:
                return None
            marker = Marker(folder, **document)
            inside = all(map(_is_inside, marker.names)) and _is_name(document["partial"])
        except (AttributeError, KeyError, TypeError):  # of another form
            return None
        return marker if inside else None

    @property
    def names(self) -> list[str]:
        """Paths in the folder of the written files."""
        return sorted(self._hashes)

    def write(self, name: str, data: bytes, *, durable: bool = True) -> None:
        """Write or replace a file of the folder, recorded in the marker first; raises `OSError`."""
        before = dict(self._hashes)
        self._hashes[name] = [*before.get(name, ()), content_hash(data)]
        try:
            self._save(durable=durable)
            write_file(self.folder / name, data, durable=durable, partial=self._partial)
        except OSError:
            self._hashes = before
            raise
        self._hashes[name] = [content_hash(data)]

    def adopt(self, name: str) -> None:
        """Record an existing file of the folder as written, saved by `finish`."""
        data = read_file(self.folder / name)
        if data is not None and not self.is_unchanged(name, data):
            self._hashes.setdefault(name, []).append(content_hash(data))  # beside those before

    def finish(self) -> None:
        """Mark the folder as complete; raises `OSError`."""
        self.complete = True
        self._save()

    def has_written(self, name: str, data: bytes) -> bool:
        """Whether jaxsat wrote this content to a file."""
        return content_hash(data) in self._hashes.get(name, ())

    def is_unchanged(self, name: str, data: bytes | None = None) -> bool:
        """Whether a file is as jaxsat wrote it, or missing."""
        path = self.folder / name
        if not os.path.lexists(path):
            return True
        data = read_file(path) if data is None else data
        return data is not None and self.has_written(name, data)

    def remove_partial(self) -> None:
        """Remove the partial file of a killed process."""
        self._partial.unlink(missing_ok=True)

    def foreign_files(self, is_made_of_it: NameTest = nothing) -> list[str]:
        """Return the names in the folder that are neither proven to be as jaxsat wrote them nor
        built from such files (`is_made_of_it` of the name); raises `OSError`."""
        folders = {parent.as_posix() for name in self._hashes for parent in Path(name).parents}
        foreign = []
        for name, mode in walk(self.folder):
            if name == MARKER and stat.S_ISREG(mode):
                continue
            if stat.S_ISREG(mode):
                ours = name == self._partial.name
                ours = ours or (name in self._hashes and self.is_unchanged(name))
            else:
                ours = stat.S_ISDIR(mode) and name in folders
            ours = ours or is_of_system(self.folder, name, mode)
            is_plain = stat.S_ISREG(mode) or stat.S_ISDIR(mode)  # and not a link
            if not ours and not (is_plain and is_made_of_it(name)):
                foreign.append(name)
        return sorted(foreign)

    def _save(self, *, durable: bool = True) -> None:
        document = {
            "format": FORMAT,
            "kind": self.kind,
            "about": self.about,
            "complete": self.complete,
            "partial": self._partial.name,
            "hashes": self._hashes,
        }
        text = json.dumps({**document, "check": _check(document)}, indent=1) + "\n"
        write_file(self.folder / MARKER, text, durable=durable, partial=self._partial)


def _check(document: Mapping[str, Any]) -> str:
    return content_hash(json.dumps(document, sort_keys=True).encode())


def _is_name(text: str) -> bool:
    return _is_inside(text) and Path(text).name == text


def _is_inside(name: str) -> bool:
    """Whether a path leads to a place in the folder, whatever the marker's origin."""
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts


def _is_damaged(folder: Path) -> bool:
    """Whether an unreadable marker exists that is not an earlier version's."""
    text = read_or_explain(folder / MARKER)
    return text is not None and EARLIER not in text


class UnverifiedWarning(UserWarning):
    """A file was read that no marker shows to be as jaxsat wrote it."""


def unverified(folder: Path) -> str | None:
    """Return a warning for a folder whose files no marker verifies; None with a marker.

    Raises `OutputError` for a marker that is damaged or cannot be read.
    """
    if _sound_marker(folder) is not None:
        return None
    return (
        f"files in {folder} are not verified: it has no {MARKER} of this version, which would show "
        "that they are as jaxsat wrote them."
    )


def _sound_marker(folder: Path) -> Marker | None:
    with explained(folder, "read"):
        marker = Marker.read(folder)
    if marker is None and _is_damaged(folder):
        raise OutputError(f"{folder / MARKER} was damaged, or changed, since jaxsat wrote it.")
    return marker


def read_unchanged(path: Path) -> bytes | None:
    """Return the content of a plain file, None for a missing one.

    A file that no marker verifies is read with an `UnverifiedWarning`. Raises `OutputError` for a
    file that cannot be read, for one that jaxsat wrote to its folder and that is missing or
    changed, and in a folder whose marker is damaged.
    """
    data = read_or_explain(Path(os.path.realpath(path)))
    if not is_verified(path, data) and data is not None:
        unknown = f"{path} is not verified: jaxsat did not write it to its folder."
        remark = unverified(path.parent) or unknown
        warnings.warn(remark, UnverifiedWarning, stacklevel=1)  # once for all that read it
    return data


def is_verified(path: Path, data: bytes | None) -> bool:
    """Whether a marker vouches for what a file holds, None where it is not there.

    Raises `OutputError` for what is not as jaxsat wrote it, and where the marker is damaged.
    """
    marker = _sound_marker(path.parent)
    if marker is None or path.name not in marker.names:
        return False
    if data is None:
        raise OutputError(f"{path} was removed, or replaced, since jaxsat wrote it.")
    if not marker.has_written(path.name, data):
        raise OutputError(f"{path} was damaged, or changed, since jaxsat wrote it.")
    return True


def foreign_files_in(folder: Path, is_made_of_it: NameTest = nothing) -> list[str]:
    """Return the names in a folder not proven to be jaxsat's: without a marker all user files.

    Raises `OSError`.
    """
    marker = Marker.read(folder)
    return user_files_in(folder) if marker is None else marker.foreign_files(is_made_of_it)


def remove_folder(folder: Path, is_made_of_it: NameTest = nothing) -> list[str]:
    """Remove a folder if all of it is jaxsat's or a system's; else return the foreign names.

    Raises `OSError`.
    """
    foreign_files = foreign_files_in(folder, is_made_of_it)
    if foreign_files:
        return foreign_files
    entries = list(walk(folder))
    for name, mode in reversed(entries):  # the content of a folder comes after it
        if name != MARKER:
            (folder / name).rmdir() if stat.S_ISDIR(mode) else (folder / name).unlink()
    (folder / MARKER).unlink(missing_ok=True)
    folder.rmdir()  # fails if a file has come meanwhile
    return []


def abbreviated(names: list[str]) -> str:
    """Return the first three of some names, for a message."""
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")
