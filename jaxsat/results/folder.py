"""An output folder that appears complete or not at all."""

import contextlib
import ctypes
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from types import TracebackType

from jaxsat.results.errors import OutputError, system_failure
from jaxsat.results.locking import FolderLock, lock_folder, remove_stale

MARKER = ".jaxsat.json"
"""File by which jaxsat knows a folder as its own; it lists everything that jaxsat wrote there."""


class OutputFolder:
    """A context manager that gives a temporary folder and renames it to its target at the end.

    Inside the `with` block write into `folder.path`. When the block ends the folder takes its
    name in one step; when it ends by an exception nothing is left. An existing target is refused
    unless `overwrite` is set, and replaced only if jaxsat wrote everything that is in it.
    Raises `OutputError`, on construction for what can be known by then.
    """

    target: Path
    overwrite: bool
    path: Path
    _lock: FolderLock

    def __init__(self, target: str | Path, *, overwrite: bool = False):
        self.target = Path(os.path.realpath(target))
        self.overwrite = overwrite
        self._new_parents: list[Path] = []
        _explain(target, self._refuse_what_is_there)

    def __enter__(self) -> "OutputFolder":
        """Make the temporary folder beside the target."""
        try:
            _explain(self.target, self._make_temporary)
        except BaseException:
            self._remove_new_parents()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Put the folder in its place, or remove it."""
        try:
            if kind is None:
                _explain(self.target, self._finish)
        finally:
            shutil.rmtree(self.path, ignore_errors=True)
            self._lock.close()
            self._remove_new_parents()
        if isinstance(error, OSError):
            raise system_failure(_reason(self.target, error), error) from error

    def _refuse_what_is_there(self) -> None:
        if not os.path.lexists(self.target):
            return
        if not self.target.is_dir():
            raise OutputError(f"{self.target} is a file; give another folder with --out.")
        if not self.overwrite:
            raise OutputError(
                f"{self.target} already exists; give --overwrite to replace it, or another "
                "folder with --out."
            )
        strangers = _strangers(self.target)
        if strangers:
            raise OutputError(
                f"{self.target} holds what jaxsat did not write ({_few(strangers)}), so it is "
                "not replaced; give another folder with --out."
            )

    def _make_temporary(self) -> None:
        parent = self.target.parent
        while not parent.exists():
            self._new_parents.append(parent)
            parent = parent.parent
        if not parent.is_dir():
            raise OutputError(f"{parent} is a file; give another folder with --out.")
        self.target.parent.mkdir(parents=True, exist_ok=True)
        prefix = f".{self.target.name}.partial-"
        remove_stale(self.target.parent, prefix)
        self.path = Path(tempfile.mkdtemp(prefix=prefix, dir=self.target.parent))
        self._lock = lock_folder(self.path)
        usual = 0o777 & ~_umask()
        self.path.chmod(usual)  # mkdtemp keeps others out, which a result need not

    def _remove_new_parents(self) -> None:
        """Remove the parents that were made for a result which did not come."""
        for parent in self._new_parents:
            with contextlib.suppress(OSError):  # not empty, and then it stays
                parent.rmdir()

    def _finish(self) -> None:
        written = sorted(entry.name for entry in self.path.iterdir())
        marker = {"written_by": "jaxsat", "entries": written}
        (self.path / MARKER).write_text(json.dumps(marker, indent=1) + "\n", encoding="utf-8")
        self._refuse_what_is_there()
        if self.target.exists():
            _swap(self.path, self.target)  # what was there is removed with the temporary folder
        else:
            self.path.rename(self.target)


def _strangers(folder: Path) -> list[str]:
    """What a folder holds that its marker does not list; everything where there is no marker."""
    found = {entry.name for entry in folder.iterdir()}
    try:
        marker = json.loads((folder / MARKER).read_text(encoding="utf-8"))
        known = {MARKER, *marker["entries"]} if marker["written_by"] == "jaxsat" else set()
    except (OSError, ValueError, KeyError, TypeError):
        known = set()
    return sorted(found - known)


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (", …" if len(names) > 3 else "")


def _swap(one: Path, other: Path) -> None:
    """Exchange two folders: in one step where the system can, else by way of a third name."""
    if sys.platform == "linux" and _exchange(one, other):
        return
    aside = one.with_name(one.name + "-old")
    other.rename(aside)
    try:
        one.rename(other)
    except BaseException:
        aside.rename(other)
        raise
    aside.rename(one)


def _exchange(one: Path, other: Path) -> bool:
    """`renameat2` with RENAME_EXCHANGE; False where the C library or file system lacks it."""
    at_working_directory, exchange = -100, 2
    try:
        renameat2 = ctypes.CDLL(None).renameat2
    except (OSError, AttributeError):
        return False
    status = renameat2(
        at_working_directory, os.fsencode(one), at_working_directory, os.fsencode(other), exchange
    )
    return status == 0


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _explain(target: str | Path, action) -> None:
    try:
        action()
    except OSError as error:
        raise system_failure(_reason(target, error), error) from error


def _reason(target: str | Path, error: OSError) -> str:
    return f"{target} cannot be written: {error.strerror or error}."
