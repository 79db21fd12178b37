"""Execution of chunks by the workers of a dask scheduler, possibly on other machines.

Needs the extra `cluster`. Only this process writes to the study's store. Access to a scheduler
allows execution of code with the rights of its users.
"""

import logging
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

from distributed import Client, Future, KilledWorker, WorkerPlugin, get_worker, wait
from distributed.utils import silence_logging_cmgr

from jaxsat.studies.connection import (
    ANSWER_S,
    PARTING_S,
    connected,
    in_time,
    reason,
    scheduler_address,
)
from jaxsat.studies.executors import POLL_S, AbstractExecutor, ClusterError, Stop, Work
from jaxsat.studies.worker import Done, Failed, PickledWork, computed, packed

AHEAD = 2
"""Chunks submitted per worker thread: one being computed, one waiting."""

CONNECT_S = 10.0
"""Time limit, s, for a connection to a scheduler."""

WITHOUT_WORKERS_S = 3600.0
"""Time limit, s, for a scheduler without workers."""

SHIPPED_S = 300.0
"""Time limit, s, for the present workers to import the modules of a study."""

LOOK_S = 5.0
"""Interval, s, between checks of the scheduler and its workers."""

T = TypeVar("T")


@dataclass(frozen=True)
class Scheduler(AbstractExecutor):
    """Workers of the dask scheduler at an address, which may come and go while a study runs.

    The `address` is one such as tcp://host:8786, or the JSON file that the scheduler wrote. The
    connection follows dask's configuration: with a tls:// address and `distributed.comm.tls`
    encrypted and authenticated, else open to all who reach the address.

    The work is sent to every worker once, also to later ones, so that it compiles once there. The
    chunks of a worker that died are computed again. `tell` receives reports that there are no
    workers yet, or no longer. Raises `ClusterError` if no scheduler answers within `timeout`
    seconds, or one stops answering or is of another version; if there are no workers for `patience`
    seconds; if they cannot import jaxsat; and if one chunk's workers die repeatedly; `ValueError`
    for neither an address nor a scheduler's file.
    """

    address: str
    timeout: float = CONNECT_S
    patience: float = WITHOUT_WORKERS_S
    tell: Callable[[str], None] = field(default=lambda _: None, repr=False, compare=False)
    _stop: Stop = field(default_factory=Stop, init=False, repr=False, compare=False)

    def __post_init__(self):
        object.__setattr__(self, "address", scheduler_address(self.address, self.timeout))

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield results in order of completion; raises `ClusterError` after a call of `stop`."""
        with self._stop.run(), _Link.to(self) as link:
            yield from link.results(packed(work), iter(chunks), self._stop)

    def stop(self) -> None:
        """Cancel the submitted chunks and release the workers; blocks until this is done."""
        self._stop.ask()


class _Link:
    """A connection to a scheduler, with a time limit on each answer."""

    def __init__(self, to: Scheduler, client: Client):
        self._to, self._client = to, client
        self._name = f"jaxsat-{uuid.uuid4().hex}"
        self._running: dict[Future, int] = {}
        self._threads = 0
        self._last_look = float("-inf")
        self._alone_since: float | None = None

    @staticmethod
    @contextmanager
    def to(scheduler: Scheduler) -> Iterator["_Link"]:
        with silence_logging_cmgr(logging.CRITICAL):  # errors are raised here
            link = _Link(scheduler, connected(scheduler.address, scheduler.timeout))
            try:
                yield link
            finally:
                link._leave()

    def results(
        self, work: PickledWork, remaining: Iterator[int], stop: Stop
    ) -> Iterator[tuple[int, Any]]:
        plugin = _Shipped(work)
        self._ask(lambda: self._client.register_plugin(plugin, name=self._name), SHIPPED_S)
        while True:
            self._look()
            room = AHEAD * max(1, self._threads)
            while len(self._running) < room and (chunk := next(remaining, None)) is not None:
                self._running[self._submit(chunk)] = chunk
            if not self._running:
                return
            for future in self._wait_for_first(stop):
                chunk = self._running.pop(future)
                yield chunk, self._result(future, chunk, stop)

    def _submit(self, chunk: int) -> Future:
        key = f"{self._name}-{chunk}"
        return self._client.submit(_compute, self._name, chunk, key=key, pure=False)

    def _wait_for_first(self, stop: Stop) -> Iterable[Future]:
        while True:
            stop.check()
            self._look()
            with suppress(TimeoutError), self._lasting(), self._client.as_current():
                return cast(Any, wait(list(self._running), POLL_S, "FIRST_COMPLETED")).done

    def _result(self, future: Future, chunk: int, stop: Stop) -> Any:
        while True:
            stop.check()
            self._look()
            try:
                with suppress(TimeoutError), self._lasting():
                    outcome: Done | Failed = future.result(ANSWER_S)
                    break
            except KilledWorker as error:
                raise ClusterError(
                    f"{error.allowed_failures + 1} workers died on chunk {chunk}, the last at "
                    f"{error.last_worker.address}"
                ) from error
        if isinstance(outcome, Failed):
            raise outcome.error
        return outcome.result

    def _look(self) -> None:
        """Update the number of worker threads at regular intervals."""
        now = time.monotonic()
        if now - self._last_look < LOOK_S:
            return
        self._threads = sum(self._ask(self._workers_there, ANSWER_S).values())
        self._last_look = time.monotonic()
        if self._threads:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
            self._to.tell(
                f"the scheduler at {self._to.address} has no workers; "
                f"waiting {self._to.patience:g} s for one"
            )
        elif now - self._alone_since > self._to.patience:
            raise ClusterError(
                f"the scheduler at {self._to.address} had no workers for {self._to.patience:g} s"
            )

    def _workers_there(self) -> dict[str, int]:
        """Threads of every worker; retries if a busy scheduler rejects the request."""
        until = time.monotonic() + ANSWER_S
        while True:
            try:
                return cast(dict[str, int], self._client.nthreads())
            except OSError:
                if self._client.status != "running" or time.monotonic() > until:
                    raise
            time.sleep(POLL_S)

    def _ask(self, question: Callable[[], T], limit: float) -> T:
        with self._lasting():
            try:
                return in_time(question, limit)
            except TimeoutError:
                raise OSError(f"no answer within {limit:g} s") from None

    @contextmanager
    def _lasting(self) -> Iterator[None]:
        """Convert errors of the connection and the workers to `ClusterError` with a message."""
        try:
            yield
        except (ClusterError, KilledWorker, TimeoutError):
            raise
        except (OSError, CancelledError) as error:
            raise ClusterError(f"the scheduler is gone: {reason(error)}") from error
        except Exception as error:  # exceptions of the work arrive as `Failed`
            raise ClusterError(f"the workers cannot compute: {reason(error)}") from error

    def _leave(self) -> None:
        for parting in (self._take_back, self._client.close):
            with suppress(Exception):  # the scheduler may be gone
                in_time(parting, PARTING_S)

    def _take_back(self) -> None:
        if self._client.status == "running":
            self._client.cancel(list(self._running))
            self._client.unregister_worker_plugin(self._name)


class _Shipped(WorkerPlugin):
    """Work of a study on a worker, unpacked once."""

    def __init__(self, work: PickledWork):
        self._packed = work

    def setup(self, worker) -> None:
        self._lock = threading.Lock()
        self._work: Work | None = None

    def compute(self, chunk: int) -> Done | Failed:
        with self._lock:
            if self._work is None:
                self._work = self._packed.unpacked()
        return computed(self._work, chunk)


def _compute(name: str, chunk: int) -> Done | Failed:
    return cast(_Shipped, get_worker().plugins[name]).compute(chunk)
