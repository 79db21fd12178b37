"""Where the chunks of a study are computed."""

import abc
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from typing import Any

Work = Callable[[int], Any]
"""Computes one chunk, given its number; can be pickled."""


class ClusterError(Exception):
    """Workers that cannot be reached or do not live; the message says what happened."""


class AbstractExecutor(abc.ABC):
    """Computes chunks, a bounded number at a time, in any order."""

    @abc.abstractmethod
    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Pairs of chunk and result as they are ready; `chunks` is read no faster than needed."""


@dataclass(frozen=True)
class Serial(AbstractExecutor):
    """One chunk after the other."""

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """The results in the order of the chunks."""
        for chunk in chunks:
            yield chunk, work(chunk)


@dataclass(frozen=True)
class Threads(AbstractExecutor):
    """Several chunks at once in the threads of this process; compiled code runs in parallel."""

    workers: int

    def __post_init__(self):
        if self.workers < 1:
            raise ValueError(f"Argument `workers` must be at least 1, but got {self.workers}.")

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """The results as they are ready. The first chunk goes alone, so that it compiles once."""
        remaining = iter(chunks)
        for chunk in remaining:
            yield chunk, work(chunk)
            break
        with ThreadPoolExecutor(self.workers, thread_name_prefix="jaxsat") as pool:
            running: dict[Future, int] = {}
            try:
                while True:
                    while len(running) < self.workers:
                        chunk = next(remaining, None)
                        if chunk is None:
                            break
                        running[pool.submit(work, chunk)] = chunk
                    if not running:
                        return
                    ready, _ = wait(running, return_when=FIRST_COMPLETED)
                    for future in ready:
                        yield running.pop(future), future.result()
            finally:
                for future in running:
                    future.cancel()
