"""The ledger of a store: which chunks are done, and by what their files are known."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxsat.store.chunks import STATUS, chunk_file, chunk_hash, decoded
from jaxsat.store.errors import OutputError, reason, system_failure
from jaxsat.store.files import read_file
from jaxsat.store.header import Header
from jaxsat.store.journal import Journal

LEDGER = f"{STATUS}/ledger"
"""Beside the status, which says the same to other programs: Zarr does not look there."""

_CLEAN = {"clean": True}


class ChunkRecord(NamedTuple):
    """What is done of a chunk: its first `cases`; the hash of every column's file."""

    cases: int
    hashes: Mapping[str, str]


class Ledger:
    """The chunks that are done, in a journal; one is noted once its files are on the disk.

    `done` has their records and `known` every chunk that was ever noted; `damaged` is how many
    lines could not be read, -1 for a ledger that is not there. `tokens` are those under which
    files were to be written by processes that did not end well. Raises `OutputError`.
    """

    tokens: list[str]
    done: dict[int, ChunkRecord]
    known: set[int]
    damaged: int

    def __init__(self, store: Path, header: Header):
        self._header = header
        self._journal = Journal(store / LEDGER, header.tag)
        self.done, self.known = {}, set()
        self.tokens = []
        try:
            found = self._journal.read()
        except OSError as error:
            message = f"{self._journal.path} cannot be read: {reason(error)}."
            raise system_failure(message, error) from error
        self._entries = [] if found is None else found.good
        self.damaged = -1 if found is None else found.damaged
        for entry in self._entries:
            if not self._apply(entry):
                self.damaged += 1

    @staticmethod
    def empty(header: Header) -> bytes:
        """The ledger of a new store."""
        return Journal(Path(LEDGER), header.tag).content([{"store": True}])

    @property
    def end(self) -> int:
        """The cases from the first one to the last one that is done."""
        size = self._header.chunk
        return max((chunk * size + record.cases for chunk, record in self.done.items()), default=0)

    def add_token(self, token: str) -> None:
        """Note under which token files will be written; raises `OSError`."""
        self._append({"writing": token}, durable=False)

    def add(self, chunk: int, record: ChunkRecord) -> None:
        """Note a chunk whose files are on the disk; raises `OSError`."""
        self._append({"chunk": chunk, "cases": record.cases, "hashes": dict(record.hashes)})

    def remove(self, chunk: int) -> None:
        """Note that a chunk is not done after all; raises `OSError`."""
        self._append({"chunk": chunk, "cases": 0, "hashes": {}})

    def clean(self) -> None:
        """Note that no partial file is left; raises `OSError`."""
        if self.tokens:
            self._append(_CLEAN)

    def rewrite(self) -> None:
        """Write the ledger again without the lines that cannot be read; raises `OSError`."""
        good = [entry for entry in self._entries if self._apply(entry)]
        self._journal.write(good or [{"store": True}])
        self.damaged = 0

    def _append(self, entry: dict[str, Any], *, durable: bool = True) -> None:
        self._journal.append(entry, durable=durable)
        self._entries.append(entry)
        self._apply(entry)

    def _apply(self, entry: Mapping[str, Any]) -> bool:
        """Take an entry in; false for one that makes no sense."""
        if entry == _CLEAN:
            self.tokens = []
        elif "writing" in entry:
            self.tokens.append(str(entry["writing"]))
        elif "chunk" in entry:
            return self._apply_record(entry["chunk"], entry.get("cases"), entry.get("hashes"))
        return True

    def _apply_record(self, chunk: Any, cases: Any, hashes: Any) -> bool:
        if not (isinstance(chunk, int) and isinstance(cases, int) and isinstance(hashes, dict)):
            return False
        if chunk < 0 or not 0 <= cases <= self._header.chunk:
            return False
        if cases and set(hashes) != set(self._header.columns):
            return False
        self.known.add(chunk)
        self.done.pop(chunk, None)
        if cases:
            self.done[chunk] = ChunkRecord(cases, hashes)
        return True


def status_chunks(store: Path) -> set[int]:
    """The chunks that the status knows of; raises `OutputError`."""
    folder = store / STATUS / "c"
    try:
        names = os.listdir(folder)
    except (FileNotFoundError, NotADirectoryError):
        return set()
    except OSError as error:
        raise system_failure(f"{folder} cannot be read: {reason(error)}.", error) from error
    return {int(name) for name in names if re.fullmatch("[0-9]{1,15}", name)}


def read_ledger(store: Path, header: Header) -> Ledger:
    """The ledger of a store that is only read; raises `OutputError` for one that is damaged."""
    told = status_chunks(store)  # before the ledger, which is written first
    ledger = Ledger(store, header)
    if ledger.damaged or told - ledger.known:
        raise OutputError(
            f"{store / LEDGER} is damaged, so it cannot be told which cases are done; run the same "
            "study again, which mends it."
        )
    return ledger


def read_chunk_file(
    store: Path, header: Header, chunk: int, name: str, record: ChunkRecord
) -> bytes | None:
    """The file of a chunk's column if it is what the ledger says; raises `OutputError`."""
    path = store / chunk_file(name, header.columns[name], chunk)
    try:
        data = read_file(path)
    except OSError as error:
        raise system_failure(f"{path} cannot be read: {reason(error)}.", error) from error
    known = data is not None and chunk_hash(name, chunk, data) == record.hashes[name]
    return data if known else None


def read_chunk(
    store: Path, header: Header, chunk: int, name: str, record: ChunkRecord
) -> np.ndarray | None:
    """A column of the done cases of a chunk; None if its file is not what the ledger says."""
    data = read_chunk_file(store, header, chunk, name, record)
    if data is None:
        return None
    return decoded(header.columns[name], data, header.chunk)[: record.cases]
