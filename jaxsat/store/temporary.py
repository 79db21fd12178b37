"""Folders that are made beside their target and take its name once complete.

A folder has one writer: its lock ends with the process that holds it, however it ends.
"""

import contextlib
import errno
import glob
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from jaxsat.store.files import OutputError, explained, sync_files, sync_folder
from jaxsat.store.marker import MARKER, Marker, remove_folder
from jaxsat.store.system_files import user_files_in


def lock_folder(path: Path) -> contextlib.ExitStack:
    """Lock a folder for this process until the result is closed.

    Raises `OutputError` while another one holds it.
    """
    with explained(path, "opened"):
        handle = _open(path)
    try:
        _lock(handle)
    except OSError as error:
        os.close(handle)
        message = f"{path} is being written to by another process."
        raise OutputError(message, failure=True) from error
    lock = contextlib.ExitStack()
    lock.callback(os.close, handle)
    return lock


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


LOCKED_BY = 10.0
"""Age in s from which a folder without a lock has no process that writes to it."""


class TemporaryFolder(NamedTuple):
    """A new folder beside a target, marked with its own name and locked by this process."""

    path: Path
    marker: Marker
    lock: contextlib.ExitStack

    def remove(self) -> None:
        """Remove the rest of the folder, and release the lock."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.lock.close()


def temporary_folder(target: Path, kind: str) -> TemporaryFolder:
    """Make a folder beside `target`, after removing stale ones; raises `OSError`."""
    prefix = f".{target.name}.partial-"
    remove_stale(target.parent, prefix)
    path = Path(tempfile.mkdtemp(prefix=prefix, dir=target.parent))
    lock = lock_folder(path)
    try:
        path.chmod(0o777 & ~_umask())  # mkdtemp excludes other users; a result need not
        return TemporaryFolder(path, Marker.make(path, kind, {"folder": path.name}), lock)
    except BaseException:
        shutil.rmtree(path, ignore_errors=True)
        lock.close()
        raise


def remove_stale(parent: Path, prefix: str) -> None:
    """Remove the folders of that prefix whose writers, which held locks on them, have died.

    Only folders that `temporary_folder` made, without other content, are removed; a folder too
    young to be locked yet is kept, and so are all on systems without locks.
    """
    if sys.platform == "win32":
        return
    for folder in parent.glob(f"{glob.escape(prefix)}*"):
        with contextlib.suppress(OutputError, OSError):
            old = time.time() - folder.lstat().st_mtime > LOCKED_BY
            if old and folder.is_dir() and not folder.is_symlink():
                with lock_folder(folder):
                    marker = Marker.read(folder)
                    if marker is None or marker.complete:
                        continue
                    if marker.about.get("folder") == folder.name:
                        remove_folder(folder)


def make_folder(
    target: Path,
    kind: str,
    files: Mapping[str, bytes],
    mark: Callable[[Path], object] | None = None,
) -> None:
    """Make a folder with these files, in place of an empty one or of none; raises `OSError`.

    `mark` gives it a marker of its own; without `mark` it has none. If another process was faster,
    its folder is kept.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_folder(target, kind)
    try:
        for name, data in files.items():
            (temporary.path / name).parent.mkdir(parents=True, exist_ok=True)
            temporary.marker.write(name, data, durable=False)
        sync_files([temporary.path / name for name in files])
        (temporary.path / MARKER).unlink()
        if mark is not None:
            mark(temporary.path)
        sync_folder(temporary.path)
        try:
            if target.is_dir() and is_absent_or_empty(target):
                remove_folder(target)
            temporary.path.rename(target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
        sync_folder(target.parent)
    finally:
        temporary.remove()


def is_absent_or_empty(target: Path) -> bool:
    """Whether a name does not exist, or is a folder without files except a system's own.

    Raises `OSError`.
    """
    if not os.path.lexists(target):
        return True
    return target.is_dir() and not user_files_in(target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
