"""Folders in which a user's own modules are found, here and in worker processes."""

import sys
import threading
from collections.abc import Iterable

_ADDED: list[str] = []
_adding = threading.Lock()


def add_folders(folders: Iterable[str]) -> None:
    """Let modules be imported from these folders, after all others."""
    with _adding:
        for folder in folders:
            if folder not in _ADDED:
                _ADDED.append(folder)
            if folder not in sys.path:
                sys.path.append(folder)


def added_folders() -> tuple[str, ...]:
    """The folders that have been added, for a worker to add too."""
    return tuple(_ADDED)
