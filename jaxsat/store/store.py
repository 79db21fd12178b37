"""Results of a study on disk: a Zarr store that grows chunk by chunk.

A chunk's files are written first, then its record in the ledger, by which an interrupted study
resumes, and at last its status. Files are replaced whole, so killing a run loses at most the chunks
in progress. Every file of a chunk is checked against the ledger when the store is continued;
damaged chunks count as not done.
"""

import contextlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.store.arrays import StoreArrays
from jaxsat.store.chunks import (
    METADATA,
    Column,
    Coordinate,
    as_json,
    chunk_hash,
    chunk_numbers,
    encoded,
)
from jaxsat.store.files import OutputError, explained, reason, write_file
from jaxsat.store.header import OTHER_PROGRAM, Header, differences, read_header, run_record
from jaxsat.store.ledger import ChunkRecord, Ledger, read_chunk, read_chunk_file, status_chunks
from jaxsat.store.provenance import machine
from jaxsat.store.temporary import is_absent_or_empty, lock_folder, make_folder


class StudyStore:
    """A study's results, open for writing by this process alone.

    `identity` is everything that the numbers depend on, as plain data; `columns` are the results of
    a case, and `coordinates` label their axes by name.

    A missing folder is made; one that holds the same study is continued, if need be with more
    cases. Raises `OutputError` for a folder that holds another study or other content, that another
    process writes to, or (unless `elsewhere`) that was begun with other versions or on another
    processor, where the bits may differ. A `remark` is kept with the versions. `repairs` lists the
    damage, a line each; the affected chunks are not done.
    """

    count: int
    repairs: list[str]

    def __init__(
        self,
        path: str | Path,
        identity: Mapping[str, Any],
        columns: Mapping[str, Column],
        count: int,
        chunk: int,
        *,
        coordinates: Mapping[str, Coordinate] | None = None,
        elsewhere: bool = False,
        remark: str | None = None,
    ):
        if count < 1 or chunk < 1:
            raise ValueError(f"Cases and chunk must be at least 1, but got {count} and {chunk}.")
        coordinates = dict(coordinates or {})
        _require_fitting(columns, coordinates)
        self.path = Path(path)
        self.repairs = []
        plain = json.loads(json.dumps(identity))
        runs = [run_record(machine(), remark)]
        study_header = Header(plain, runs, dict(columns), coordinates, chunk)
        self._make(study_header)
        self._lock = lock_folder(self.path)
        try:
            self._header = self._continue(study_header, elsewhere)
            self._ledger = Ledger(self.path, self._header)
            self._arrays = StoreArrays(self.path, self._header, self._ledger, self.repairs)
            with self._writing():
                self._repair()
            self.count = max(count, self._ledger.end)
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> "StudyStore":
        """Return the store itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Let other processes write."""
        self.close()

    def close(self) -> None:
        """Leave a store that other programs can read, and let other processes write."""
        try:
            with contextlib.suppress(OSError, OutputError):  # left to the next process
                self._arrays.close()
        finally:
            self._lock.close()

    @property
    def chunk(self) -> int:
        """Number of cases in a chunk; the last may have fewer."""
        return self._header.chunk

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.chunk)

    def numbers(self, chunk: int) -> np.ndarray:
        """Return the cases of a chunk."""
        return chunk_numbers(chunk, self.chunk, self.count)

    def is_done(self, chunk: int) -> bool:
        """Whether all cases of a chunk are done."""
        record = self._ledger.done.get(chunk)
        return record is not None and record.cases >= len(self.numbers(chunk))

    def done(self) -> list[int]:
        """Return the completed chunks, in order."""
        return sorted(filter(self.is_done, self._ledger.done))

    def pending(self) -> Iterator[int]:
        """Return the chunks that are not done, in order."""
        return (chunk for chunk in range(self.chunks) if not self.is_done(chunk))

    def write(self, chunk: int, values: Mapping[str, np.ndarray]) -> None:
        """Store the results of a chunk, column by column, then mark it done."""
        numbers, columns = self.numbers(chunk), self._header.columns
        if set(values) != set(columns):
            missing = sorted(set(values) ^ set(columns))
            raise ValueError(f"Argument `values` must have the store's columns; see {missing}.")
        files = {}
        for name, column in columns.items():
            array = np.asarray(values[name], column.dtype)
            if array.shape != (len(numbers), *column.shape):
                raise ValueError(
                    f"Column {name} must have shape {(len(numbers), *column.shape)}, "
                    f"but got {array.shape}."
                )
            files[name] = encoded(column, array, self.chunk)
        hashes = {name: chunk_hash(name, chunk, data) for name, data in files.items()}
        with self._writing():
            if chunk in self._ledger.done:  # with fewer cases, and its files will change
                self._ledger.withdraw(chunk)
            self._arrays.grow(int(numbers[-1]) + 1, self.count)
            self._arrays.write_chunk(chunk, files)
            self._ledger.write(chunk, ChunkRecord(len(numbers), hashes))
            self._arrays.write_status(chunk, len(numbers))

    def values(self, chunk: int, names: list[str]) -> dict[str, np.ndarray]:
        """Return some columns of a chunk, as stored."""
        record = self._ledger.done[chunk]
        columns = {}
        for name in names:
            data = read_chunk(self.path, self._header, chunk, name, record)
            if data is None:
                raise OutputError(
                    f"{self.path} is damaged while it is used (chunk {chunk}, {name}); run the "
                    "same study again.",
                    failure=True,
                )
            columns[name] = data[: len(self.numbers(chunk))]
        return columns

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Convert system errors of a change of the store to `OutputError`."""
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"{self.path} cannot be written: {reason(error)}. Its contents are intact; "
                "free disk space and run the same study again to resume.",
                failure=True,
            ) from error

    def _make(self, header: Header) -> None:
        """Make the store beside the target, then rename it: there is never half a store."""
        with explained(self.path, "made"):
            if not is_absent_or_empty(self.path):
                return
            files = {METADATA: header.content(), **header.coordinate_files()}
            for name, metadata in header.metadata(0).items():
                files[f"{name}/{METADATA}"] = as_json(metadata)
            make_folder(self.path, "study", files)

    def _continue(self, study_header: Header, elsewhere: bool) -> Header:
        """Return the header of the continued store."""
        if not self.path.is_dir():
            raise OutputError(f"{self.path} is a file; give another folder.")
        header = read_header(self.path)
        other = differences(header.identity, study_header.identity)
        layouts = ({**one.layout(), "chunk": None} for one in (header, study_header))
        other += differences(*(json.loads(json.dumps(layout)) for layout in layouts))
        if other == [OTHER_PROGRAM]:  # versions may be the reason
            other += differences(header.runs[-1]["machine"], machine())
        if other:
            raise OutputError(
                f"{self.path} holds another study ({'; '.join(other)}); give another folder."
            )
        other = differences(header.runs[-1]["machine"], machine())
        if not other:
            return header
        if not elsewhere:
            raise OutputError(
                f"{self.path} was written under other conditions ({'; '.join(other)}), so its "
                "results may differ in their last bits from those to come; allow that explicitly "
                "or give another folder.",
                elsewhere=True,
            )
        header = header._replace(runs=[*header.runs, *study_header.runs])
        with self._writing():
            write_file(self.path / METADATA, header.content())
        return header

    def _repair(self) -> None:
        self._arrays.begin()
        if self._ledger.damaged:
            self.repairs.append(
                f"the ledger had {len(self._ledger.damaged)} records that cannot be read; these "
                "chunks are computed again"
            )
            for chunk in sorted(self._ledger.damaged):
                self._ledger.withdraw(chunk)
        for chunk, record in sorted(self._ledger.done.items()):
            bad = [
                name
                for name in self._header.columns
                if read_chunk_file(self.path, self._header, chunk, name, record) is None
            ]
            if bad:
                self._withdraw_damaged(chunk, f"was damaged ({', '.join(bad)})")
        self._check_status()
        self._arrays.repair()

    def _withdraw_damaged(self, chunk: int, what: str) -> None:
        self.repairs.append(f"chunk {chunk} {what} and is computed again")
        self._ledger.withdraw(chunk)

    def _check_status(self) -> None:
        """Match the status to the ledger, which may have lost chunks that the status has."""
        for chunk in sorted(self._ledger.chunks | status_chunks(self.path)):
            if chunk not in self._ledger.chunks:
                self._withdraw_damaged(chunk, "was lost from the ledger")
            record = self._ledger.done.get(chunk)
            self._arrays.write_status(chunk, 0 if record is None else record.cases)


def _require_fitting(columns: Mapping[str, Column], coordinates: Mapping[str, Coordinate]) -> None:
    """Raise `ValueError` where axes and coordinates of columns do not match."""
    sizes = {name: len(coordinate.values) for name, coordinate in coordinates.items()}
    for name, column in columns.items():
        if len(column.dims) != len(column.shape):
            raise ValueError(f"Column {name} must have a name for every axis, but got {column}.")
        for axis, size in zip(column.dims, column.shape, strict=True):
            if sizes.setdefault(axis, size) != size:
                raise ValueError(
                    f"Axis {axis} of column {name} must have length {sizes[axis]}, but got {size}."
                )
