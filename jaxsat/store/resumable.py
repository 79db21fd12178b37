"""A folder that a command resumes; only jaxsat's own files are replaced, each whole."""

import contextlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.store.files import OutputError, explained, read_or_explain
from jaxsat.store.marker import Marker, abbreviated, remove_folder
from jaxsat.store.temporary import is_absent_or_empty, lock_folder, make_folder


class ResumableFolder:
    """A folder of one kind of result, open for writing by this process alone.

    A missing or empty folder is made, with `about`, plain data, in its marker; one of the same kind
    is continued. A user's files beside the results are kept. Raises `OutputError` for a folder with
    other content, one that another process writes to, and one with a changed file of jaxsat's.
    """

    path: Path
    about: Mapping[str, Any]

    def __init__(self, path: str | Path, kind: str, about: Mapping[str, Any]):
        self.path = Path(os.path.realpath(path))
        self._kind = kind
        self._new = False
        with explained(path, "made"):
            if is_absent_or_empty(self.path):
                self._new = True
                make_folder(self.path, kind, {}, lambda folder: Marker.make(folder, kind, about))
        if not self.path.is_dir():
            raise OutputError(f"{path} is a file; give another folder with --out.")
        self._lock = lock_folder(self.path)
        try:
            with explained(path, "read"):
                self._marker = self._read_marker()
            self.about = self._marker.about
        except BaseException:
            self.close()
            raise

    @staticmethod
    def of_any_kind(path: str | Path) -> "ResumableFolder":
        """Return an existing folder of results of any kind, to add to it."""
        marker = Marker.read(Path(path))
        return ResumableFolder(path, "result" if marker is None else marker.kind, {})

    def __enter__(self) -> "ResumableFolder":
        """Return the folder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *exception: object) -> None:
        """Let other processes write; a new folder without results is removed after an exception."""
        if kind is not None and self._new and not self._marker.names:
            with contextlib.suppress(OSError):
                remove_folder(self.path)
        self.close()

    def close(self) -> None:
        """Let other processes write."""
        self._lock.close()

    @property
    def is_begun(self) -> bool:
        """Whether a file was ever written."""
        return bool(self._marker.names)

    def is_complete(self, name: str) -> bool:
        """Whether this file and every other one ever written exist."""
        names = self._marker.names
        return name in names and all((self.path / one).is_file() for one in names)

    def read(self, name: str) -> bytes | None:
        """Return the content written to a file; None if the file is missing.

        Raises `OutputError` for a changed file.
        """
        data = read_or_explain(self.path / name)
        if data is None or not self._marker.has_written(name, data):
            self._refuse(name)
        return data

    def write(self, name: str, content: str | bytes) -> None:
        """Write or replace a file in one step.

        Raises `OutputError` for a changed file, which is then kept.
        """
        data = content.encode() if isinstance(content, str) else content
        self._refuse(name)
        more = " Earlier results are intact; the same command resumes."
        with explained(self.path / name, "written", more):
            (self.path / name).parent.mkdir(exist_ok=True)
            self._marker.write(name, data)

    def read_arrays(self, name: str) -> dict[str, np.ndarray] | None:
        """Return the arrays of an NPZ file as `read` returns its content."""
        content = self.read(name)
        if content is None:
            return None
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return dict(arrays)

    def write_arrays(self, name: str, arrays: Mapping[str, Any]) -> None:
        """Write or replace an NPZ file as `write` does."""
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        self.write(name, buffer.getvalue())

    def _read_marker(self) -> Marker:
        marker = Marker.read(self.path)
        if marker is None:
            names = abbreviated(sorted(os.listdir(self.path)))
            raise OutputError(
                f"{self.path} holds what jaxsat did not write ({names}), "
                "or what another version of it wrote; give another folder with --out."
            )
        if marker.kind != self._kind:
            raise OutputError(
                f"{self.path} holds another kind of result ({marker.kind}, not {self._kind}); "
                "give another folder with --out."
            )
        marker.remove_partial()
        for name in marker.names:
            if not marker.is_unchanged(name):
                self._refuse_changed(name)
        return marker

    def _refuse(self, name: str) -> None:
        with explained(self.path / name, "read"):
            is_ours = self._marker.is_unchanged(name)
        if not is_ours:
            self._refuse_changed(name)

    def _refuse_changed(self, name: str) -> None:
        raise OutputError(
            f"{self.path / name} was damaged, or changed, since jaxsat wrote it; move it away, and "
            "the same command writes it again."
        )
