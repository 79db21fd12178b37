"""Computation of a study into its store, chunk by chunk, until it is done or a rule is met."""

import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from jaxsat.core.once import once_property
from jaxsat.store.chunks import chunk_numbers
from jaxsat.store.files import OutputError
from jaxsat.store.header import differences
from jaxsat.store.provenance import machine
from jaxsat.store.store import StudyStore
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import AbstractExecutor, Serial
from jaxsat.studies.statistics import AbstractStopRule


@dataclass(frozen=True)
class StudyProgress:
    """Progress of a study: cases done and total, settled ones, and the rate of this run."""

    done: int
    count: int
    settled: int
    rate: float

    @property
    def seconds_left(self) -> float:
        """Remaining time, s, at the rate so far."""
        return (self.count - self.done) / self.rate if self.rate > 0 else float("inf")

    @property
    def fraction_settled(self) -> float:
        """Fraction of the done cases that settled."""
        return self.settled / self.done if self.done else float("nan")


def run_study(
    study: Study,
    path: str | Path,
    *,
    executor: AbstractExecutor | None = None,
    until: AbstractStopRule | None = None,
    report: Callable[[StudyProgress], None] | None = None,
    tell: Callable[[str], None] = warnings.warn,
    elsewhere: bool = False,
) -> int:
    """Compute the missing chunks of a study in the store at `path`; return the valid cases' number.

    With a stop rule, valid are the chunks from the first up to the one that meets the rule, in
    whatever order they are computed. `elsewhere` lets a store be continued with other versions or
    on another processor. `tell` receives reports of damage in the store, which is computed again.
    Raises `OutputError` if the store cannot be used, and `ValueError` for a stop rule over a Latin
    hypercube, whose size is fixed.
    """
    if until is not None and study.has_fixed_size:
        raise ValueError("A stop rule must have independent or Sobol draws, not a Latin hypercube.")
    executor = Serial() if executor is None else executor
    identity, columns = study.identity(), study.columns()
    with StudyStore(
        path,
        identity,
        columns,
        study.count,
        study.chunk,
        coordinates=study.coordinates(),
        elsewhere=elsewhere,
        remark=study.remark,
    ) as store:
        for repair in store.repairs:
            tell(f"{path}: {repair}")
        ledger = _StudyLedger(store, study.count, until)
        begin, before = time.perf_counter(), ledger.done
        here = None if elsewhere else machine()
        work = _ChunkWork(study, store.chunk, store.count, here, identity["program"])
        results = executor.run(work, ledger.wanted())
        for chunk, values in results:
            store.write(chunk, values)
            ledger.add(chunk, values)
            if report is not None:
                pace = (ledger.done - before) / (time.perf_counter() - begin)
                report(StudyProgress(ledger.done, study.count, ledger.settled, pace))
        return ledger.counted


@dataclass(frozen=True)
class _ChunkWork:
    """A picklable function that computes the chunks of a study, if the program there is the same.

    Restricted to the machine `where` if one is given.
    """

    study: Study
    chunk: int
    count: int
    where: Mapping[str, Any] | None
    program: Mapping[str, Any]

    def __call__(self, chunk: int) -> dict[str, np.ndarray]:
        if self.where is not None:
            other = differences(self.where, machine())
            if other:
                raise OutputError(
                    f"A worker computes under other conditions ({'; '.join(other)}), so its "
                    "results may differ in their last bits; allow that explicitly.",
                    elsewhere=True,
                )
        other = differences({"program": self.program}, {"program": self._program_here})
        if other:
            raise OutputError(f"A worker computes another study ({'; '.join(other)}).")
        numbers = chunk_numbers(chunk, self.chunk, self.count)
        return self.study.values(numbers)

    @once_property
    def _program_here(self) -> dict[str, Any]:
        """Identity of the program in this process, whose law or libraries may differ."""
        return self.study.program_identity()


class _StudyLedger:
    """Chunks that are done, and the number of consecutive cases from the first on."""

    def __init__(self, store: StudyStore, count: int, until: AbstractStopRule | None):
        self._store, self._until = store, until
        self._limit = count
        self._chunks = -(-count // store.chunk)
        self._shares: dict[int, tuple[int, Any]] = {}
        self.done = self.settled = self.counted = 0
        self._successes: Any = 0
        self._next = 0
        self._met = False
        names = list({"settling_time", self._column})
        for chunk in store.done():
            if chunk < self._chunks:
                self.add(chunk, store.values(chunk, names))

    @property
    def _column(self) -> str:
        return "settling_time" if self._until is None else self._until.column

    def wanted(self) -> Iterator[int]:
        """Yield the chunks to compute, until the rule is met."""
        for chunk in self._store.pending():
            if self._met or chunk >= self._chunks:
                return
            yield chunk

    def add(self, chunk: int, values: Mapping[str, np.ndarray]) -> None:
        """Add a completed chunk."""
        settled = np.isfinite(values["settling_time"])
        successes = None if self._until is None else self._until.successes(values[self._column])
        self._shares[chunk] = (len(settled), successes)
        self.done += len(settled)
        self.settled += int(settled.sum())
        while not self._met and self._next in self._shares:
            cases, successes = self._shares.pop(self._next)
            self._next += 1
            self.counted += cases
            if self._until is not None:
                self._successes = self._successes + successes
                self._met = self._until.met(self._successes, self.counted)
        self.counted = min(self.counted, self._limit)
