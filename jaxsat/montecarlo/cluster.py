"""Chunks computed by the workers of dask.distributed: processes here, or machines elsewhere.

Needs the extra `cluster`. Only this process writes to the study's store.
"""

import logging
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, cast

import cloudpickle
import jax
from distributed import Client, Future, KilledWorker, LocalCluster, WorkerPlugin, get_worker, wait

from jaxsat.montecarlo.executors import AbstractExecutor, ClusterError, Work
from jaxsat.processors import share_of

AHEAD = 2
"""Chunks that are given out for every thread of a worker: one to compute, one to go on with."""

POLL_S = 0.2
"""How often a run looks whether it is to stop."""

PATIENCE_S = 10.0
"""How long a run that is to stop may take to let its workers go."""

DEAF_TO_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""A terminal sends Ctrl-C to the workers as well; who started them ends them, in good order."""


@dataclass(frozen=True)
class Cluster(AbstractExecutor):
    """The workers of a dask cluster, which may come and go while a study runs.

    `connect` gives a client as a context manager; see `local_processes` and `scheduler_at`. What is
    to be computed is sent to every worker once, so that it compiles once there, and to those that
    come later or replace one that died. The chunks of a worker that died are computed again.
    Raises `ClusterError` where no scheduler answers, or no longer, or one chunk's workers die again
    and again.
    """

    connect: Callable[[], AbstractContextManager[Client]]
    _stopping: threading.Event = field(default_factory=threading.Event, repr=False, compare=False)
    _idle: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """The results as they are ready; raises `ClusterError` where `stop` was called."""
        name = f"jaxsat-{uuid.uuid4().hex}"
        with self._idle, self.connect() as client:
            double = bool(jax.config.read("jax_enable_x64"))
            client.register_plugin(_Shipped(cloudpickle.dumps(work), double), name=name)
            try:
                yield from _as_ready(client, name, iter(chunks), self._stopping)
            except (OSError, CancelledError) as error:
                if client.status == "running":  # it is the work's own
                    raise
                raise ClusterError(f"the scheduler is gone: {_reason(error)}") from error
            finally:
                with suppress(OSError):  # of a scheduler that is gone
                    client.unregister_worker_plugin(name)

    def stop(self) -> None:
        """Take back what is given out and let the workers go; waits until they are."""
        self._stopping.set()
        if self._idle.acquire(timeout=PATIENCE_S):
            self._stopping.clear()
            self._idle.release()


def local_processes(count: int, threads: int = 1) -> Cluster:
    """`count` worker processes on this machine with `threads` threads each."""
    for name, value in (("count", count), ("threads", threads)):
        if value < 1:
            raise ValueError(f"Argument `{name}` must be at least 1, but got {value}.")

    @contextmanager
    def connect():
        with (
            LocalCluster(
                n_workers=count,
                threads_per_worker=threads,
                processes=True,
                memory_limit=0,
                dashboard_address=":0",
                preload=[DEAF_TO_CTRL_C],
                silence_logs=logging.CRITICAL,  # what counts is raised here
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client

    return Cluster(connect)


def scheduler_at(place: str, timeout: float = 10.0) -> Cluster:
    """The workers of a scheduler at an address such as tcp://host:8786, or named in a JSON file.

    Waits `timeout` seconds for the scheduler, and for its first worker as long as it takes.
    """

    @contextmanager
    def connect():
        by_file = place.endswith(".json")
        try:
            client = (
                Client(scheduler_file=place, timeout=timeout)
                if by_file
                else Client(place, timeout=timeout)
            )
        except (OSError, ValueError) as error:
            raise ClusterError(f"no scheduler answers at {place}: {_reason(error)}") from error
        with client:
            yield client

    return Cluster(connect)


def _reason(error: BaseException) -> str:
    """What an error says, in one line."""
    return " ".join(str(error).split()) or type(error).__name__


class _Shipped(WorkerPlugin):
    """What a worker keeps of a study: the work, unpacked once in the precision of the sender."""

    def __init__(self, packed: bytes, double_precision: bool):
        self._packed, self._double_precision = packed, double_precision

    def setup(self, worker) -> None:
        del worker
        self._lock = threading.Lock()
        self._work: Work | None = None

    def compute(self, chunk: int):
        with self._lock:
            if self._work is None:
                # before unpacking, which would round arrays to the precision of the moment
                jax.config.update("jax_enable_x64", self._double_precision)
                self._work = cast(Work, cloudpickle.loads(self._packed))
        with share_of(1):  # of the worker's threads, which are the scheduler's to give out
            return self._work(chunk)


def _compute(name: str, chunk: int):
    return cast(_Shipped, get_worker().plugins[name]).compute(chunk)


def _as_ready(
    client: Client, name: str, remaining: Iterator[int], stopping: threading.Event
) -> Iterator[tuple[int, Any]]:
    running: dict[Future, int] = {}
    try:
        while True:
            threads = cast(Mapping[str, int], client.nthreads())
            room = AHEAD * max(1, sum(threads.values()))
            while len(running) < room and (chunk := next(remaining, None)) is not None:
                future = client.submit(_compute, name, chunk, key=f"{name}-{chunk}", pure=False)
                running[future] = chunk
            if not running:
                return
            for future in _first_done(list(running), stopping):
                yield running.pop(future), _result(future)
    finally:
        client.cancel(list(running))


def _first_done(futures: list[Future], stopping: threading.Event) -> Iterable[Future]:
    while not stopping.is_set():
        with suppress(TimeoutError):
            return cast(Any, wait(futures, POLL_S, "FIRST_COMPLETED")).done
    raise ClusterError("the run was stopped")


def _result(future: Future):
    try:
        return future.result()
    except KilledWorker as error:
        raise ClusterError(f"the workers died again and again on a chunk: {error}") from error
