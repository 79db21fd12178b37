"""An output folder that appears complete or not at all."""

import contextlib
import ctypes
import os
import stat
import sys
from pathlib import Path
from types import TracebackType

from jaxsat.store.files import OutputError, explained, sync_file, sync_folder, system_failure
from jaxsat.store.marker import (
    MARKER,
    Marker,
    NameTest,
    abbreviated,
    foreign_files_in,
    nothing,
    remove_folder,
)
from jaxsat.store.system_files import walk
from jaxsat.store.temporary import TemporaryFolder, temporary_folder


class OutputFolder:
    """A context manager with a temporary folder that it renames to its target at the end.

    Inside the `with` block call `write`, or write into `folder.path`. At the end of the block the
    folder takes its name in one step; after an exception nothing is left. An existing target is
    refused unless `overwrite` is set, and replaced only if it holds the same `kind` of result and
    every file in it is as jaxsat wrote it, or built from that (`is_made_of_it` of its name).
    `option` is the command-line option that names the target. Raises `OutputError`, already on
    construction where possible.
    """

    target: Path
    overwrite: bool
    path: Path
    _made: TemporaryFolder

    def __init__(
        self,
        target: str | Path,
        *,
        kind: str = "result",
        overwrite: bool = False,
        option: str = "--out",
        is_made_of_it: NameTest = nothing,
    ):
        self.target = Path(os.path.realpath(target))
        self.overwrite = overwrite
        self._kind, self._option, self._is_made_of_it = kind, option, is_made_of_it
        self._else = f"give another folder with {option}"
        self._new_parents: list[Path] = []
        with explained(target, "written"):
            self._refuse_what_is_there()

    def __enter__(self) -> "OutputFolder":
        """Make the temporary folder beside the target."""
        try:
            with explained(self.target, "written"):
                self._make_temporary()
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
                with explained(self.target, "written"):
                    self._finish()
            else:
                self._made.remove()
        finally:
            self._made.lock.close()
            self._remove_new_parents()
        if isinstance(error, OSError):
            raise system_failure(self.target, "written", error) from error

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file into the folder; `OSError` becomes an `OutputError` at the block's end.

        The name may begin with folders, separated by slashes.
        """
        data = content.encode() if isinstance(content, str) else content
        (self.path / name).parent.mkdir(parents=True, exist_ok=True)
        self._made.marker.write(name, data, durable=False)  # synced at the end

    @property
    def names(self) -> list[str]:
        """Names of the files that `write` has written."""
        return self._made.marker.names

    def _refuse_what_is_there(self) -> None:
        if not os.path.lexists(self.target):
            return
        if not self.target.is_dir():
            raise OutputError(f"{self.target} is a file; {self._else}.")
        if not self.overwrite:
            raise OutputError(
                f"{self.target} already exists; give --overwrite to replace it, or another folder "
                f"with {self._option}."
            )
        foreign_files = foreign_files_in(self.target, self._is_made_of_it)
        if foreign_files:
            raise OutputError(
                f"{self.target} holds what jaxsat did not write, or what was changed since "
                f"({abbreviated(foreign_files)}), so it is not replaced; {self._else}."
            )
        marker = Marker.read(self.target)
        if marker is not None and marker.kind != self._kind:
            raise OutputError(
                f"{self.target} holds another kind of result ({marker.kind}, not {self._kind}), "
                f"so it is not replaced; {self._else}."
            )

    def _make_temporary(self) -> None:
        parent = self.target.parent
        while not parent.exists():
            self._new_parents.append(parent)
            parent = parent.parent
        if not parent.is_dir():
            raise OutputError(f"{parent} is a file; {self._else}.")
        self.target.parent.mkdir(parents=True, exist_ok=True)
        self._made = temporary_folder(self.target, self._kind)
        self.path = self._made.path

    def _remove_new_parents(self) -> None:
        """Remove parent folders made for a result that was not written."""
        for parent in self._new_parents:
            with contextlib.suppress(OSError):  # not empty, and then it stays
                parent.rmdir()

    def _finish(self) -> None:
        try:
            self._make_durable()
            self._refuse_what_is_there()
            is_replacement = self.target.exists()
            if is_replacement:
                _swap(self.path, self.target)
            else:
                self.path.rename(self.target)
        except BaseException:
            self._made.remove()
            raise
        sync_folder(self.target.parent)
        if is_replacement:
            self._remove_replaced()

    def _make_durable(self) -> None:
        for name, mode in walk(self.path):
            if stat.S_ISREG(mode):
                if name != MARKER:
                    self._made.marker.adopt(name)
                sync_file(self.path / name)
            elif stat.S_ISDIR(mode):
                sync_folder(self.path / name)
        self._made.marker.finish()
        sync_folder(self.path)

    def _remove_replaced(self) -> None:
        """Remove the replaced folder; raises `OutputError` if it has files that came late."""
        foreign_files = remove_folder(self.path, self._is_made_of_it)
        if foreign_files:
            raise OutputError(
                f"{self.target} is written, but what came to the folder that it replaced "
                f"({abbreviated(foreign_files)}) was kept in {self.path}."
            )


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
    """Whether `renameat2` with RENAME_EXCHANGE succeeded; the system may lack it."""
    at_working_directory, exchange = -100, 2
    try:
        renameat2 = ctypes.CDLL(None).renameat2
    except (OSError, AttributeError):
        return False
    status = renameat2(
        at_working_directory, os.fsencode(one), at_working_directory, os.fsencode(other), exchange
    )
    return status == 0
