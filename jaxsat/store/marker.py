"""How jaxsat knows its own: a marker in every folder says what the folder is and what was written.

The marker is one document, replaced whole. It names a file's hash before the file is written, and
one name for all files while they are written. So even what a killed process left can be told from
what a user put there, and only what is unchanged since jaxsat wrote it is ever replaced or removed.
"""

import json
import os
import re
import stat
import warnings
from collections.abc import Callable, Iterator, Mapping
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

MARKER = ".jaxsat"
"""File by which jaxsat knows a folder as its own."""

FORMAT = 2

EARLIER = b'"written_by"'
"""What markers of format 1 have and no later one; files beside one are read as they are."""

SYSTEM_FILES = frozenset(
    {".ds_store", ".localized", "icon\r", "thumbs.db", "ehthumbs.db", "desktop.ini", ".directory"}
)
"""Files, in small letters, that file managers leave in every folder that they open; they hold no
data of a user."""

SYSTEM_FOLDERS = frozenset({"__MACOSX", ".AppleDouble", "@eaDir"})
"""Folders in which archives of macOS, file servers of it and those of Synology keep such files."""

SYNOLOGY = re.compile(r"SYNO.*|.*@Syno\w+")
"""Names of pictures and attributes that a Synology server keeps in `@eaDir`."""

APPLE_DOUBLE = b"\x00\x05\x16\x07"
"""How a file begins in which macOS keeps what another file system cannot hold of a file: `._NAME`,
or any name in a folder for such files."""


NameTest = Callable[[str], bool]
"""Whether a file or folder is one that a build makes of what jaxsat wrote, by its name within."""


def nothing(name: str) -> bool:
    """False: a build makes nothing, whatever the name."""
    return False


def _is_of_system(folder: Path, name: str, mode: int) -> bool:
    """Whether a file or folder of this name within `folder` is one that a system leaves.

    Raises `OSError`.
    """
    *parents, last = name.split("/")
    systems = SYSTEM_FOLDERS.intersection(parents)
    if stat.S_ISDIR(mode):
        return bool(systems) or last in SYSTEM_FOLDERS
    if not stat.S_ISREG(mode):
        return False
    if last.lower() in SYSTEM_FILES or ("@eaDir" in systems and SYNOLOGY.fullmatch(last)):
        return True
    if not systems and not last.startswith("._"):
        return False
    with (folder / name).open("rb") as file:
        return file.read(len(APPLE_DOUBLE)) == APPLE_DOUBLE


def _is_plain(mode: int) -> bool:
    """Whether it is a file or a folder, and no link."""
    return stat.S_ISREG(mode) or stat.S_ISDIR(mode)


class Marker:
    """What a folder is, and the hashes of all that was written to it.

    `kind` is the type of the result, such as "run"; `about` is plain data kept with it; `complete`
    says that nothing is to come. `partial` is the name of files while they are written.
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
        """The marker of a folder that this process has just made; raises `OSError`."""
        marker = Marker(folder, kind, about, partial_name(new_token()))
        marker._save()
        return marker

    @staticmethod
    def read(folder: Path) -> "Marker | None":
        """The marker that a folder has, if it has one that can be read; raises `OSError`."""
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
        """The files that were written, by their paths in the folder."""
        return sorted(self._hashes)

    def write(self, name: str, data: bytes, *, durable: bool = True) -> None:
        """Write a file of the folder, or replace it, once the marker knows it; raises `OSError`."""
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
        """Know a file that is in the folder as written for it, once `finish` says so."""
        data = read_file(self.folder / name)
        if data is not None and not self.is_unchanged(name, data):
            self._note(name, data)

    def finish(self) -> None:
        """Say that nothing is to come; raises `OSError`."""
        self.complete = True
        self._save()

    def has_written(self, name: str, data: bytes) -> bool:
        """Whether this is what jaxsat wrote to a file."""
        return content_hash(data) in self._hashes.get(name, ())

    def is_unchanged(self, name: str, data: bytes | None = None) -> bool:
        """Whether a file is as jaxsat wrote it, or not there."""
        path = self.folder / name
        if not os.path.lexists(path):
            return True
        data = read_file(path) if data is None else data
        return data is not None and self.has_written(name, data)

    def remove_partial(self) -> None:
        """Remove the file that a killed process was about to write."""
        self._partial.unlink(missing_ok=True)

    def foreign_files(self, is_made_of_it: NameTest = nothing) -> list[str]:
        """What is in the folder and not proven to be as jaxsat wrote it, nor what a build makes of
        that, as `is_made_of_it` says of a name; raises `OSError`."""
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
            ours = ours or _is_of_system(self.folder, name, mode)
            if not ours and not (_is_plain(mode) and is_made_of_it(name)):
                foreign.append(name)
        return sorted(foreign)

    def _note(self, name: str, data: bytes) -> None:
        """Expect a content of a file; until it is there, what was there before is right too."""
        self._hashes.setdefault(name, []).append(content_hash(data))

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
    """Whether a path is the name of something that lies in the folder itself."""
    return _is_inside(text) and Path(text).name == text


def _is_inside(name: str) -> bool:
    """Whether a path leads to a place in the folder, whoever wrote the marker."""
    path = Path(name)
    return not path.is_absolute() and ".." not in path.parts


def _is_damaged(folder: Path) -> bool:
    """Whether a marker that cannot be read is there, and not one of an earlier version's lines."""
    text = read_or_explain(folder / MARKER)
    return text is not None and EARLIER not in text


class UnverifiedWarning(UserWarning):
    """A file is read that no marker shows to be as jaxsat wrote it."""


def unverified(folder: Path) -> str | None:
    """What to tell of a folder whose files no marker vouches for; None where one does.

    Raises `OutputError` where the marker is damaged or the system will not read it.
    """
    return _no_marker(folder) if _sound_marker(folder) is None else None


def _no_marker(folder: Path) -> str:
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
    """The content of a plain file, None where there is none.

    A file for which no marker vouches is read with an `UnverifiedWarning`. Raises `OutputError`
    where the system will not read it, for a file that jaxsat wrote to its folder and that is not
    there any longer or is not as jaxsat wrote it, and in a folder whose marker is damaged.
    """
    data = read_or_explain(Path(os.path.realpath(path)))
    marker = _sound_marker(path.parent)
    if marker is None or path.name not in marker.names:
        if data is not None:
            unknown = f"{path} is not verified: jaxsat did not write it to its folder."
            remark = _no_marker(path.parent) if marker is None else unknown
            warnings.warn(remark, UnverifiedWarning, stacklevel=1)  # once for all that read it
        return data
    if data is None:
        raise OutputError(f"{path} was removed, or replaced, since jaxsat wrote it.")
    if not marker.has_written(path.name, data):
        raise OutputError(f"{path} was damaged, or changed, since jaxsat wrote it.")
    return data


def walk(folder: Path, within: str = "") -> Iterator[tuple[str, int]]:
    """Path and mode of everything in a folder, each folder before what is in it; no link followed.

    Raises `OSError`.
    """
    with os.scandir(folder / within) as entries:
        sorted_entries = sorted(entries, key=lambda entry: entry.name)
    for entry in sorted_entries:
        name = f"{within}{entry.name}"
        mode = entry.stat(follow_symlinks=False).st_mode
        yield name, mode
        if stat.S_ISDIR(mode):
            yield from walk(folder, f"{name}/")


def foreign_files_in(folder: Path, is_made_of_it: NameTest = nothing) -> list[str]:
    """What is in a folder and not proven to be jaxsat's: without a marker all that users put there.

    Raises `OSError`.
    """
    marker = Marker.read(folder)
    return user_files_in(folder) if marker is None else marker.foreign_files(is_made_of_it)


def user_files_in(folder: Path, within: str = "") -> list[str]:
    """What is in a folder but what a system leaves; raises `OSError`."""
    found = []
    with os.scandir(folder / within) as entries:
        names = sorted(
            (f"{within}{one.name}", one.stat(follow_symlinks=False).st_mode) for one in entries
        )
    for name, mode in names:
        if not _is_of_system(folder, name, mode):
            found.append(name)
        elif stat.S_ISDIR(mode):
            found += user_files_in(folder, f"{name}/")
    return found


def remove_folder(folder: Path, is_made_of_it: NameTest = nothing) -> list[str]:
    """Remove a folder if all of it is jaxsat's, or a system's; else nothing, and say what is not.

    Raises `OSError`.
    """
    foreign_files = foreign_files_in(folder, is_made_of_it)
    if foreign_files:
        return foreign_files
    entries = list(walk(folder))
    for name, mode in reversed(entries):  # what is in a folder comes after it
        if name != MARKER:
            (folder / name).rmdir() if stat.S_ISDIR(mode) else (folder / name).unlink()
    (folder / MARKER).unlink(missing_ok=True)
    folder.rmdir()  # which fails if something has come meanwhile
    return []


def abbreviated(names: list[str]) -> str:
    """The first of some names, for a message."""
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")
