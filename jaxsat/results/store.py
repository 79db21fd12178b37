"""The results of a study on disk: a Zarr store made in full at the start and filled chunk by chunk.

Every case has a status, written after the case's results; the status is the ledger from which a
broken-off study goes on. Files are replaced whole, so killing a run loses at most the chunks that
it was working on.
"""

import contextlib
import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import zarr

from jaxsat.results.errors import OutputError, system_failure
from jaxsat.results.locking import lock_folder, remove_stale
from jaxsat.results.provenance import machine, provenance

FORMAT = 1
DONE = 1
"""The status of a case that is; 0 before."""

CASE = "case"

SHOWN = 6
"""Differences between two studies that are told."""

PROGRAM = ("program",)
"""What of an identity is told last: numbers without names, most of which a scenario names."""


class Column(NamedTuple):
    """How one result of a case is stored: shape and type of one case's value, and its label."""

    shape: tuple[int, ...]
    dtype: str
    units: str
    long_name: str


class StudyStore:
    """A study's results, open for writing by this process alone.

    `identity` is all that the numbers depend on, as plain data; `columns` says what a case has.
    A folder that is not there is made; one that holds the same study is continued, if need be
    with more cases. Raises `OutputError` for a folder that holds another study or anything else,
    that another process writes to, or (unless `elsewhere`) that was begun with other versions or
    on another processor, where the bits may differ. A `remark` is kept with the versions.
    """

    def __init__(
        self,
        path: str | Path,
        identity: Mapping[str, Any],
        columns: Mapping[str, Column],
        count: int,
        chunk: int,
        *,
        elsewhere: bool = False,
        remark: str | None = None,
    ):
        self.path = Path(path)
        self._remark = remark
        self._identity = json.loads(json.dumps(identity))
        self._columns = dict(columns)
        self._arrays: dict[str, zarr.Array] = {}
        if not os.path.lexists(self.path) or self._is_empty():
            self._make(count, chunk)
        self._lock = lock_folder(self.path)
        try:
            self._continue(count, elsewhere)
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> "StudyStore":
        """The store itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Let other processes write."""
        self.close()

    def close(self) -> None:
        """Let other processes write."""
        self._lock.close()

    @property
    def count(self) -> int:
        """How many cases there is room for."""
        return self._array("status").shape[0]

    @property
    def chunk(self) -> int:
        """Cases in a chunk; the last may have fewer."""
        return self._array("status").chunks[0]

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return -(-self.count // self.chunk)

    def numbers(self, chunk: int) -> np.ndarray:
        """The cases of a chunk."""
        return chunk_numbers(chunk, self.chunk, self.count)

    def pending(self) -> np.ndarray:
        """The chunks that are not done."""
        done = np.asarray(self._array("status")[:]) == DONE
        return np.unique(np.flatnonzero(~done) // self.chunk)

    def write(self, chunk: int, values: Mapping[str, np.ndarray]) -> None:
        """Keep the results of a chunk, column by column, then mark it done."""
        numbers = self.numbers(chunk)
        place = slice(int(numbers[0]), int(numbers[-1]) + 1)
        if set(values) != set(self._columns):
            missing = sorted(set(values) ^ set(self._columns))
            raise ValueError(f"Argument `values` must have the store's columns; see {missing}.")
        with self._writing():
            for name, column in self._columns.items():
                self._array(name)[place] = np.asarray(values[name], column.dtype)
            for name in self._columns:
                self._keep(name, chunk)  # on the disk before the ledger says so
            self._array("status")[place] = np.full(len(numbers), DONE, np.uint8)
            self._keep("status", chunk)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        """Tell what the system has against a change of the store."""
        try:
            yield
        except OSError as error:
            raise OutputError(
                f"{self.path} cannot be written: {error.strerror or error}. What is in it is good; "
                "make room and run the same study again to go on.",
                failure=True,
            ) from error

    def _keep(self, name: str, chunk: int) -> None:
        """Have the system write a chunk's file to the disk, if it has one: all NaN is no file."""
        array = self._array(name)
        key = array.metadata.encode_chunk_key((chunk, *(0 for _ in array.shape[1:])))
        with contextlib.suppress(FileNotFoundError), (self.path / name / key).open("rb") as file:
            os.fsync(file.fileno())

    def values(self, chunk: int, names: list[str]) -> dict[str, np.ndarray]:
        """Some columns of a chunk, as stored."""
        numbers = self.numbers(chunk)
        place = slice(int(numbers[0]), int(numbers[-1]) + 1)
        return {name: np.asarray(self._array(name)[place]) for name in names}

    def _array(self, name: str) -> zarr.Array:
        if name not in self._arrays:
            self._arrays[name] = cast(zarr.Array, self._group[name])
        return self._arrays[name]

    def _is_empty(self) -> bool:
        return self.path.is_dir() and not any(self.path.iterdir())

    def _make(self, count: int, chunk: int) -> None:
        """Beside the target, then in its place at once: there is never half a store."""
        if count < 1 or chunk < 1:
            raise ValueError(f"Cases and chunk must be at least 1, but got {count} and {chunk}.")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            prefix = f".{self.path.name}.partial-"
            remove_stale(self.path.parent, prefix)
            made = Path(tempfile.mkdtemp(prefix=prefix, dir=self.path.parent))
            lock = lock_folder(made)
            try:
                _make_arrays(made, self._columns, count, chunk, self._identity, self._remark)
                made.chmod(0o755)
                self._put_in_place(made)
            finally:
                shutil.rmtree(made, ignore_errors=True)
                lock.close()
        except OSError as error:
            message = f"{self.path} cannot be made: {error.strerror or error}."
            raise system_failure(message, error) from error

    def _put_in_place(self, made: Path) -> None:
        """Give a new store its name, unless another process was faster: its store is continued."""
        try:
            made.rename(self.path)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise

    def _open(self) -> None:
        try:
            self._group = zarr.open_group(self.path, mode="r+")
        except (FileNotFoundError, NotADirectoryError, ValueError, KeyError) as error:
            raise OutputError(f"{self.path} is no store of jaxsat; give another folder.") from error
        except OSError as error:
            message = f"{self.path} cannot be read: {error.strerror or error}."
            raise system_failure(message, error) from error
        if self._group.attrs.get("jaxsat_format") != FORMAT:
            raise OutputError(f"{self.path} is no store of jaxsat; give another folder.")

    def _continue(self, count: int, elsewhere: bool) -> None:
        if not self.path.is_dir():
            raise OutputError(f"{self.path} is a file; give another folder.")
        self._open()
        other = differences(self._group.attrs["identity"], self._identity)
        if other:
            raise OutputError(
                f"{self.path} holds another study ({'; '.join(other)}); give another folder."
            )
        runs = list(cast(list, self._group.attrs["runs"]))
        other = differences(runs[-1]["machine"], machine())
        if other and not elsewhere:
            raise OutputError(
                f"{self.path} was written under other conditions ({'; '.join(other)}), so its "
                "results may differ in their last bits from those to come; allow that explicitly "
                "or give another folder."
            )
        with self._writing():
            if other:
                self._group.attrs["runs"] = [*runs, _record(self._remark)]
            if count > self.count:
                for array in [*self._columns, "status"]:
                    whole = self._array(array)
                    whole.resize((count, *whole.shape[1:]))


def chunk_numbers(chunk: int, size: int, count: int) -> np.ndarray:
    """The cases of one of the chunks of `size` cases, `count` in all."""
    return np.arange(chunk * size, min((chunk + 1) * size, count))


def study_columns(path: str | Path) -> dict[str, zarr.Array]:
    """The results of a study by name, read when used, without their labels."""
    return dict(sorted(cast(zarr.Group, zarr.open_group(path, mode="r")).arrays()))


def differences(old: Any, new: Any) -> list[str]:
    """Where two nests of plain data differ, one clause for each place; of many the first few."""
    found = sorted(_differences(old, new), key=lambda place: (place[0][:1] == PROGRAM, place[0]))
    clauses = [f"{'.'.join(path)}: {_short(x)} there, {_short(y)} here" for path, x, y in found]
    more = len(clauses) - SHOWN
    return [*clauses[:SHOWN], f"and {more} more"] if more > 0 else clauses


def _differences(old: Any, new: Any, *path: str) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Path, old and new value of every place where they differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in sorted(set(old) | set(new)):
            yield from _differences(old.get(key), new.get(key), *path, key)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (x, y) in enumerate(zip(old, new, strict=True), 1):
            yield from _differences(x, y, *path, str(number))
    elif old != new:
        yield path, old, new


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "…"


def _record(remark: str | None) -> dict[str, Any]:
    told = {} if remark is None else {"remark": remark}
    return {"machine": machine(), **provenance(), **told}


def _make_arrays(
    path: Path, columns: Mapping[str, Column], count: int, chunk: int, identity, remark: str | None
):
    group = zarr.create_group(path, zarr_format=3)
    group.attrs.update(
        {
            "Conventions": "CF-1.11",
            "jaxsat_format": FORMAT,
            "identity": identity,
            "runs": [_record(remark)],
        }
    )
    _make_array(group, "status", Column((), "uint8", "1", "1 where the case is done"), count, chunk)
    for name, column in columns.items():
        _make_array(group, name, column, count, chunk)


def _make_array(group: zarr.Group, name: str, column: Column, count: int, chunk: int) -> None:
    floating = np.issubdtype(np.dtype(column.dtype), np.floating)
    group.create_array(
        name,
        shape=(count, *column.shape),
        chunks=(chunk, *column.shape),
        dtype=column.dtype,
        fill_value=np.nan if floating else 0,
        dimension_names=(CASE, *(f"{name}_{axis}" for axis in range(len(column.shape)))),
        attributes={"units": column.units, "long_name": column.long_name},
    )
