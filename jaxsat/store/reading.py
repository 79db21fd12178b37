"""The results of a study, read when used and checked against the ledger of the store."""

from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.store.chunks import DONE, STATUS, STATUS_COLUMN
from jaxsat.store.files import OutputError
from jaxsat.store.header import Header, read_header
from jaxsat.store.ledger import ChunkRecord, Ledger, read_chunk, read_ledger


class StudyColumn:
    """One result of all cases, from the first to the last one done; NaN or 0 where not done.

    Indexed like an array, it reads the chunks that it must and nothing twice at a time. Raises
    `OutputError` where a chunk is not what was written.
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
        """Number of cases."""
        return self.shape[0]

    def __getitem__(self, key: Any) -> Any:
        """The values at these places."""
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
        """All values."""
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
    """The results of a study by name, read when used, without their labels.

    Raises `OutputError` for what is no store, or one that is damaged.
    """
    path = Path(path)
    header = read_header(path) if header is None else header
    ledger = read_ledger(path, header)
    return {
        name: StudyColumn(path, header, ledger, name) for name in sorted([*header.columns, STATUS])
    }
