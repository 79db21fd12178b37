"""Files in a folder that file managers and servers leave there, without user data."""

import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

SYSTEM_FILES = frozenset(
    {".ds_store", ".localized", "icon\r", "thumbs.db", "ehthumbs.db", "desktop.ini", ".directory"}
)
"""Files, in lower case, that file managers leave in folders that they open, without user data."""

SYSTEM_FOLDERS = frozenset({"__MACOSX", ".AppleDouble", "@eaDir"})
"""Folders for such files, by archives of macOS, its file servers and those of Synology."""

SYNOLOGY = re.compile(r"SYNO.*|.*@Syno\w+")
"""Names of pictures and attributes that a Synology server keeps in `@eaDir`."""

APPLE_DOUBLE = b"\x00\x05\x16\x07"
"""First bytes of a file with macOS metadata that another file system cannot hold: `._NAME`, or any
name in a folder for such files."""


def is_of_system(folder: Path, name: str, mode: int) -> bool:
    """Whether a file or folder of this name within `folder` is a system's own.

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


def walk(folder: Path, within: str = "") -> Iterator[tuple[str, int]]:
    """Yield path and mode of everything in a folder, parents first, without following links.

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


def user_files_in(folder: Path, within: str = "") -> list[str]:
    """Return the names in a folder except a system's own files; raises `OSError`."""
    user_files = []
    with os.scandir(folder / within) as entries:
        names = sorted(
            (f"{within}{one.name}", one.stat(follow_symlinks=False).st_mode) for one in entries
        )
    for name, mode in names:
        if not is_of_system(folder, name, mode):
            user_files.append(name)
        elif stat.S_ISDIR(mode):
            user_files += user_files_in(folder, f"{name}/")
    return user_files
