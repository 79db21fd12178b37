"""Executors of a study's chunks."""

import abc
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import jax

from jaxsat.core.checks import require_counts
from jaxsat.core.errors import ArgumentError, JaxsatError

Work = Callable[[int], Any]
"""A picklable function that computes one chunk from its number."""

POLL_S = 0.2
"""Interval, s, at which a waiting run checks whether it must stop."""

PATIENCE_S = 10.0
"""Time limit, s, for a stopping run to release its workers."""


class ClusterError(JaxsatError):
    """Workers that cannot be reached or keep dying; the message explains the failure."""

    failure = True


class AbstractExecutor(abc.ABC):
    """An executor of chunks, a bounded number at a time, in any order."""

    @property
    def at_once(self) -> int:
        """Number of chunks in the memory of this machine at once; here one."""
        return 1

    @abc.abstractmethod
    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield pairs of chunk and result in order of completion; `chunks` is consumed lazily."""

    def stop(self) -> None:  # noqa: B027 -- most have nothing to do
        """End a run in another thread, if it uses other processes.

        Threads of this process end with it, so executors without processes do nothing.
        """


class Stop:
    """A signal that ends a run of other processes from another thread; one run at a time."""

    def __init__(self):
        self._asked, self._idle = threading.Event(), threading.Lock()

    @contextmanager
    def run(self) -> Iterator[None]:
        """Context of a run, which must release its workers before exit."""
        with self._idle:
            yield

    def check(self) -> None:
        """Raise `ClusterError` if the run must end."""
        if self._asked.is_set():
            raise ClusterError("the run was stopped")

    def ask(self) -> None:
        """End the current run, and wait until it has ended."""
        self._asked.set()
        if self._idle.acquire(timeout=PATIENCE_S):
            self._asked.clear()
            self._idle.release()


@dataclass(frozen=True)
class Serial(AbstractExecutor):
    """Sequential execution of chunks."""

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield the results in the order of the chunks."""
        for chunk in chunks:
            yield chunk, work(chunk)


@dataclass(frozen=True)
class Threads(AbstractExecutor):
    """Several chunks at once in the threads of this process; compiled code runs in parallel."""

    workers: int

    def __post_init__(self):
        require_counts(workers=self.workers)

    @property
    def at_once(self) -> int:
        """One chunk for each thread."""
        return self.workers

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield results in order of completion; the first chunk runs alone, to compile once."""
        remaining = iter(chunks)
        for chunk in remaining:
            yield chunk, work(chunk)
            break
        yield from _in_pool(work, remaining, self.workers)


@dataclass(frozen=True)
class Devices(AbstractExecutor):
    """One chunk at a time on each of the first `count` local devices.

    Every device runs the single-device program, so results agree bit for bit; a program partitioned
    over devices (`jax.shard_map`) is compiled in another way and rounds differently. Raises
    `ValueError` if there are fewer devices.
    """

    count: int

    def __post_init__(self):
        available = jax.local_device_count()
        if not 1 <= self.count <= available:
            raise ArgumentError(
                "count", f"must be from 1 to the {available} devices here", self.count
            )

    @property
    def at_once(self) -> int:
        """One chunk for each device."""
        return self.count

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield the results in order of completion."""
        free = SimpleQueue[jax.Device]()
        for device in jax.local_devices()[: self.count]:
            free.put(device)

        def on_a_free_device(chunk: int):
            device = free.get()
            try:
                with jax.default_device(device):
                    return work(chunk)
            finally:
                free.put(device)

        return _in_pool(on_a_free_device, iter(chunks), self.count)


def _in_pool(work: Work, remaining: Iterator[int], workers: int) -> Iterator[tuple[int, Any]]:
    with ThreadPoolExecutor(workers, thread_name_prefix="jaxsat") as pool:
        running: dict[Future, int] = {}
        try:
            while True:
                while len(running) < workers:
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
