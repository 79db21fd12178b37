"""Arrays of a store on disk: chunks written whole, metadata with room for the cases."""

import contextlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from jaxsat.store.chunks import (
    CASE,
    CASE_COLUMN,
    DONE,
    METADATA,
    STATUS,
    STATUS_COLUMN,
    as_json,
    chunk_file,
    differs_in_rows_alone,
    encoded,
)
from jaxsat.store.files import WRITERS, OutputError, parse_json, read_file, write_file
from jaxsat.store.header import Header
from jaxsat.store.ledger import Ledger


class StoreArrays:
    """Arrays of a store for other programs to read, written by this process alone.

    The ledger, not these arrays, decides which chunks are done. `repairs` gets a line for each
    damage. System errors raise `OSError`.
    """

    def __init__(self, path: Path, header: Header, ledger: Ledger, repairs: list[str]):
        self._path, self._header, self._ledger, self._repairs = path, header, ledger, repairs
        self._rows: int | None = None
        self._pool = ThreadPoolExecutor(WRITERS, thread_name_prefix="jaxsat-store")

    def begin(self) -> None:
        """Make all folders, and remove partial files of a killed process."""
        for name in (*self._header.arrays, *self._header.coordinates):
            self._make_folder(name)
            with contextlib.suppress(FileNotFoundError):
                (self._path / name / self._header.partial).unlink()

    def repair(self) -> None:
        """Rewrite damaged coordinates and metadata to match the completed cases."""
        for place, data in self._header.coordinate_files().items():
            if read_file(self._path / place) != data:
                self._repairs.append(f"{place} was damaged and is written again")
                self._write_all({place: data})
        self._fit()

    def close(self) -> None:
        """Fit the room to the cases; then consolidate the metadata of all arrays.

        Readers use consolidated metadata alone where it exists, so it is written after the last
        change and removed before the next.
        """
        try:
            self._fit()
            self._write_header(self._header.content(self._ledger.end))
        finally:
            self._pool.shutdown()

    def grow(self, cases: int, most: int) -> None:
        """Make room for `cases` cases, with spare room so that growth is rare."""
        room = self._rows or 0
        if cases > room:
            self._make_room(min(most, max(cases, 2 * room)))

    def write_chunk(self, chunk: int, files: Mapping[str, bytes]) -> None:
        """Write the files of a chunk's columns, and its case numbers."""
        columns = self._header.columns
        places = {chunk_file(name, columns[name], chunk): data for name, data in files.items()}
        self._write_all({**places, **self._numbers(chunk)})

    def write_status(self, chunk: int, cases: int) -> None:
        """Write the status of a chunk with `cases` completed cases, if it differs."""
        place = chunk_file(STATUS, STATUS_COLUMN, chunk)
        status = encoded(STATUS_COLUMN, np.full(cases, DONE), self._header.chunk)
        content = read_file(self._path / place)
        if content != status and (cases or content is not None):
            self._write_all({place: status})

    def _fit(self) -> None:
        """Fit the room to the last completed case, with all cases numbered."""
        rows = self._ledger.end
        for chunk in range(-(-rows // self._header.chunk)):
            for place, data in self._numbers(chunk).items():
                if read_file(self._path / place) != data:
                    self._write_all({place: data})
        self._make_room(rows)

    def _numbers(self, chunk: int) -> dict[str, bytes]:
        size = self._header.chunk
        numbers = np.arange(chunk * size, (chunk + 1) * size)
        return {chunk_file(CASE, CASE_COLUMN, chunk): encoded(CASE_COLUMN, numbers, size)}

    def _make_room(self, rows: int) -> None:
        """Write every array's metadata for this number of rows; other programs use it."""
        if rows == self._rows:
            return
        stale = {}
        for name, metadata in self._header.metadata(rows).items():
            place = f"{name}/{METADATA}"
            content = read_file(self._path / place)
            if content == as_json(metadata):
                continue
            stale[place] = as_json(metadata)
            if not differs_in_rows_alone(parse_json(content), metadata):
                self._repairs.append(f"{place} was damaged and is written again")
        self._rows = None  # unknown while metadata files disagree
        if read_file(self._path / METADATA) != self._header.content(rows):
            self._write_header(self._header.content())
        if stale:
            self._write_all(stale)
        self._rows = rows

    def _write_header(self, content: bytes) -> None:
        if read_file(self._path / METADATA) != content:
            write_file(self._path / METADATA, content)

    def _write_all(self, files: Mapping[str, bytes]) -> None:
        """Write files, no two of one array, and wait until all are on disk."""

        def write(item: tuple[str, bytes]) -> None:
            path = Path(item[0])
            self._make_folder(path.parent)
            partial = self._path / path.parts[0] / self._header.partial
            write_file(self._path / path, item[1], partial=partial)

        list(self._pool.map(write, files.items()))

    def _make_folder(self, name: str | Path) -> None:
        """Make a folder of the store; raises `OutputError` for a link, for safety."""
        path = self._path
        for part in Path(name).parts:
            path /= part
            with contextlib.suppress(FileExistsError):
                path.mkdir()
            if path.is_symlink() or not path.is_dir():
                raise OutputError(f"{path} is no folder of jaxsat's; move it away.")
