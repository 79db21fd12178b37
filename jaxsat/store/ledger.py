"""Ledger of a store: completed chunks, and hashes of their files.

A chunk has a record, a file of its own that is written once the files of the chunk are on disk.
The checksums of Zarr cannot replace it: a missing chunk reads there as fill values, and a misplaced
one as that of another place. Of 300 stores damaged by `benchmarks/corruption.py` the zarr library
silently read wrong values from 78. So `StudyColumn` reads a result from its chunks when it is used,
each checked against its record.
"""

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxsat.store.chunks import DONE, STATUS, STATUS_COLUMN, chunk_file, chunk_hash, decoded
from jaxsat.store.files import (
    OutputError,
    content_hash,
    explained,
    parse_json,
    read_or_explain,
    write_file,
)
from jaxsat.store.header import Header, read_header

LEDGER = f"{STATUS}/ledger"
"""Folder beside the status, which informs other programs: Zarr does not look there."""


class ChunkRecord(NamedTuple):
    """Completed part of a chunk: its first `cases`; the hash of every column's file."""

    cases: int
    hashes: Mapping[str, str]


class Ledger:
    """Records of the chunks, each bound by a hash to its study and its chunk.

    `done` has the records of completed chunks and `withdrawn` the numbers of chunks that are no
    longer complete; `damaged` are the chunks with an unreadable record. Raises `OutputError`.
    """

    done: dict[int, ChunkRecord]
    withdrawn: set[int]
    damaged: set[int]

    def __init__(self, store: Path, header: Header):
        self._folder, self._header = store / LEDGER, header
        self.done, self.withdrawn, self.damaged = {}, set(), set()
        for chunk in _numbered_files(self._folder):
            record = self.read(chunk)
            if record is None:
                self.damaged.add(chunk)
            else:
                self._take(chunk, record)

    @property
    def end(self) -> int:
        """Number of cases from the first to the last completed one."""
        size = self._header.chunk
        return max((chunk * size + record.cases for chunk, record in self.done.items()), default=0)

    @property
    def chunks(self) -> set[int]:
        """Chunks with a readable record."""
        return self.withdrawn.union(self.done)

    def read(self, chunk: int) -> ChunkRecord | None:
        """Return the current record of a chunk on disk; None without one of this study."""
        content = read_or_explain(self._folder / str(chunk)) or b""
        check, _, text = content.partition(b" ")
        if check != self._hash(chunk, text):
            return None
        entry = parse_json(text)
        return ChunkRecord(entry["cases"], entry["hashes"])

    def write(self, chunk: int, record: ChunkRecord) -> None:
        """Record a chunk whose files are on disk; raises `OSError`."""
        text = json.dumps(record._asdict(), sort_keys=True).encode()
        content = self._hash(chunk, text) + b" " + text
        self._folder.mkdir(exist_ok=True)
        write_file(
            self._folder / str(chunk), content, partial=self._folder.parent / self._header.partial
        )
        self._take(chunk, record)

    def withdraw(self, chunk: int) -> None:
        """Record that a chunk is no longer complete; raises `OSError`."""
        self.write(chunk, ChunkRecord(0, {}))

    def _take(self, chunk: int, record: ChunkRecord) -> None:
        self.damaged.discard(chunk)
        self.withdrawn.discard(chunk)
        self.done.pop(chunk, None)
        if record.cases:
            self.done[chunk] = record
        else:
            self.withdrawn.add(chunk)

    def _hash(self, chunk: int, text: bytes) -> bytes:
        return content_hash(text, f"{self._header.tag}/{chunk}").encode()


def status_chunks(store: Path) -> set[int]:
    """Return the chunks that have a status; raises `OutputError`."""
    return _numbered_files(store / STATUS / "c")


def _numbered_files(folder: Path) -> set[int]:
    """Return the files of a folder that are named by a chunk number; raises `OutputError`."""
    with explained(folder, "read"):
        try:
            names = os.listdir(folder)
        except (FileNotFoundError, NotADirectoryError):
            return set()
    return {int(name) for name in names if re.fullmatch("0|[1-9][0-9]{0,14}", name)}


def read_ledger(store: Path, header: Header) -> Ledger:
    """Return the ledger of a store for reading; raises `OutputError` for a damaged one."""
    status = status_chunks(store)  # before the ledger, which is written first
    ledger = Ledger(store, header)
    if ledger.damaged or status - ledger.chunks:
        raise OutputError(
            f"{store / LEDGER} is damaged, so the completed cases are unknown; run the same study "
            "again to repair it."
        )
    return ledger


def read_chunk_file(
    store: Path, header: Header, chunk: int, name: str, record: ChunkRecord
) -> bytes | None:
    """Return the file of a chunk's column, None if not as recorded; raises `OutputError`."""
    data = read_or_explain(store / chunk_file(name, header.columns[name], chunk))
    intact = data is not None and chunk_hash(name, chunk, data) == record.hashes[name]
    return data if intact else None


def read_chunk(
    store: Path, header: Header, chunk: int, name: str, record: ChunkRecord
) -> np.ndarray | None:
    """Return a column of a chunk's completed cases; None if its file is not as recorded."""
    data = read_chunk_file(store, header, chunk, name, record)
    if data is None:
        return None
    return decoded(header.columns[name], data, header.chunk)[: record.cases]


class StudyColumn:
    """One result of all cases, from the first to the last completed one; NaN or 0 where not done.

    Indexed like an array, it reads only the necessary chunks, each once. Raises `OutputError` for a
    damaged chunk.
    """

    shape: tuple[int, ...]
    dtype: np.dtype

    def __init__(self, path: Path, header: Header, ledger: Ledger, name: str):
        self._path, self._header, self._ledger, self._name = path, header, ledger, name
        self.column = STATUS_COLUMN if name == STATUS else header.columns[name]
        self.shape = (ledger.end, *self.column.shape)
        self.dtype = np.dtype(self.column.dtype)

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return len(self.shape)

    def __len__(self) -> int:
        """Return the number of cases."""
        return self.shape[0]

    def labels(self, axis: str) -> tuple[str | float, ...]:
        """Return the labels along an axis of the study."""
        return self._header.coordinates[axis].values

    def __getitem__(self, key: Any) -> Any:
        """Return the values at these places."""
        first, *others = key if isinstance(key, tuple) else (key,)
        if isinstance(first, slice):
            rows = range(len(self))[first]
            low, high = (min(rows), max(rows) + 1) if rows else (0, 0)
            places: Any = np.asarray(rows, int) - low
        elif isinstance(first, (int, np.integer)):
            low = range(len(self))[int(first)]
            high, places = low + 1, 0
        else:
            low, high, places = 0, len(self), first
        return self._read(low, high)[(places, *others)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return all values."""
        values = self._read(0, len(self))
        return values if dtype is None else values.astype(dtype)

    def _read(self, low: int, high: int) -> np.ndarray:
        size = self._header.chunk
        values = np.full((high - low, *self.column.shape), self.column.fill, self.dtype)
        for chunk in range(low // size, -(-high // size)):
            record = self._ledger.done.get(chunk)
            if record is not None:
                values_of_chunk = self._chunk(chunk, record)
                start = chunk * size
                inside = slice(max(low - start, 0), min(high - start, len(values_of_chunk)))
                begin = start + inside.start - low
                part = values_of_chunk[inside]
                values[begin : begin + len(part)] = part
        return values

    def _chunk(self, chunk: int, record: ChunkRecord) -> np.ndarray:
        if self._name == STATUS:
            return np.full(record.cases, DONE, self.dtype)
        values = read_chunk(self._path, self._header, chunk, self._name, record)
        if values is None:  # unless the study has grown since the ledger was read
            now = self._ledger.read(chunk)
            if now is not None and now != record and now.cases >= record.cases:
                values = read_chunk(self._path, self._header, chunk, self._name, now)
        if values is None:
            first = chunk * self._header.chunk
            raise OutputError(
                f"{self._path}: chunk {chunk} (cases {first} to {first + record.cases - 1}) of "
                f"{self._name} is damaged; run the same study again, which computes it again."
            )
        return values[: record.cases]


def study_columns(path: str | Path, header: Header | None = None) -> dict[str, StudyColumn]:
    """Return the results of a study by name, read when used, without their labels.

    Raises `OutputError` for an invalid or damaged store.
    """
    path = Path(path)
    header = read_header(path) if header is None else header
    ledger = read_ledger(path, header)
    return {
        name: StudyColumn(path, header, ledger, name) for name in sorted([*header.columns, STATUS])
    }
