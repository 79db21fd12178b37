"""One writer a folder: a lock that ends with the process that holds it, however it ends."""

import os
import sys
from pathlib import Path

from jaxsat.store.errors import OutputError, reason, system_failure


class FolderLock:
    """A lock on a folder, held until it is closed."""

    def __init__(self, handle: int):
        self._handle: int | None = handle

    def close(self) -> None:
        """Give the folder free."""
        if self._handle is not None:
            os.close(self._handle)
            self._handle = None


def lock_folder(path: Path) -> FolderLock:
    """Lock a folder for this process; raises `OutputError` while another one holds it."""
    try:
        handle = _open(path)
    except OSError as error:
        raise system_failure(f"{path} cannot be opened: {reason(error)}.", error) from error
    try:
        _lock(handle)
    except OSError as error:
        os.close(handle)
        message = f"{path} is being written to by another process."
        raise OutputError(message, failure=True) from error
    return FolderLock(handle)


if sys.platform == "win32":
    import msvcrt

    def _open(path: Path) -> int:
        return os.open(path.with_name(f".{path.name}.lock"), os.O_RDWR | os.O_CREAT)

    def _lock(handle: int) -> None:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _open(path: Path) -> int:
        return os.open(path, os.O_RDONLY)

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
