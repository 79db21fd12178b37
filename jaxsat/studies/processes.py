"""Execution of chunks by local processes, connected by pipes alone."""

import contextlib
import pickle
import signal
import subprocess
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import IO, Any, NamedTuple, cast

from jaxsat.core.checks import require_counts
from jaxsat.studies.executors import POLL_S, AbstractExecutor, ClusterError, Stop, Work
from jaxsat.studies.worker import Done, Failed, Ready, WorkerTask, packed

ATTEMPTS = 3
"""Largest number of worker deaths on one chunk, or in succession before readiness."""

AHEAD = 1
"""Chunks that a worker holds in addition to one for each of its threads."""

PROGRAM = (
    "import pickle, sys; sys.path[:] = pickle.load(sys.stdin.buffer); "
    "from jaxsat.studies.worker import serve; serve()"
)
"""Program of a worker; its module search path is that of this process."""


@dataclass(frozen=True)
class Processes(AbstractExecutor):
    """`count` worker processes of this machine that compute `threads` chunks at once each.

    They communicate with this process through anonymous pipes: nothing listens, and no other
    process can send them work. The work is sent to every worker once, so that it compiles once
    there. A worker that dies is replaced, which is reported to `tell`, and its chunks are computed
    again, one at a time, so that a chunk is not blamed for another one. Raises `ClusterError` if
    `ATTEMPTS` workers died on a chunk, or before they could compute any, or if none can be started.
    """

    count: int
    threads: int = 1
    tell: Callable[[str], None] | None = field(default=None, repr=False, compare=False)
    _stop: Stop = field(default_factory=Stop, init=False, repr=False, compare=False)

    def __post_init__(self):
        require_counts(count=self.count, threads=self.threads)

    @property
    def at_once(self) -> int:
        """One chunk for each thread of every process."""
        return self.count * self.threads

    def run(self, work: Work, chunks: Iterable[int]) -> Iterator[tuple[int, Any]]:
        """Yield results in order of completion; raises `ClusterError` after a call of `stop`."""
        with self._stop.run():
            crew = _Crew(self, work)
            try:
                yield from crew.results(iter(chunks), self._stop)
            finally:
                crew.end()

    def stop(self) -> None:
        """End the workers; blocks until they have ended."""
        self._stop.ask()


class _End(NamedTuple):
    """End of a worker with this status; a negative one is the signal that killed it."""

    status: int

    def __str__(self) -> str:
        """Text for the last of several ends."""
        return f"the last {'was ' if self.status < 0 else ''}{self.how}"

    @property
    def how(self) -> str:
        if self.status >= 0:
            return f"ended with status {self.status}"
        try:
            name = signal.Signals(-self.status).name
        except ValueError:
            name = f"signal {-self.status}"
        likely = ", as the system does where memory runs out" if name == "SIGKILL" else ""
        return f"killed by {name}{likely}"


class _Crew:
    """Workers of a run, and the chunks that must be computed again."""

    def __init__(self, executor: Processes, work: Work):
        self._count, self._tell = executor.count, executor.tell
        self._room = executor.threads + AHEAD
        self._order = WorkerTask(packed(work), executor.threads)
        self._workers: list[_Worker] = []
        self._messages = SimpleQueue[tuple[_Worker, Any]]()
        self._again = deque[int]()
        self._deaths = Counter[int]()
        self._false_starts = 0

    def results(self, remaining: Iterator[int], stop: Stop) -> Iterator[tuple[int, Any]]:
        while True:
            self._give_out(remaining)
            if not self._workers:
                return
            worker, message = self._next_message(stop)
            if worker not in self._workers:  # a released worker
                continue
            match message:
                case Ready():
                    self._false_starts = 0
                    worker.ready = True
                case Done(chunk, result):
                    worker.chunks.remove(chunk)
                    worker.proven = True
                    yield chunk, result
                case Failed(error):
                    raise error
                case _End():
                    self._bury(worker, message)

    def end(self) -> None:
        for worker in self._workers:
            worker.kill()
        for worker in self._workers:
            worker.end()

    def _give_out(self, remaining: Iterator[int]) -> None:
        """Give chunks to workers with room; release workers without any, and start new ones."""
        for worker in list(self._workers):
            while self._has_room(worker):
                chunk = self._next_chunk(remaining, alone=not worker.chunks)
                if chunk is None:
                    break
                worker.give(chunk)
            if not worker.chunks:
                self._workers.remove(worker)
                worker.end()
        while len(self._workers) < self._count:
            chunk = self._next_chunk(remaining, alone=True)
            if chunk is None:
                break
            self._workers.append(_Worker(self._order, chunk, self._messages))

    def _has_room(self, worker: "_Worker") -> bool:
        """Whether a worker may take another chunk; first and suspect chunks run alone."""
        if not worker.chunks:
            return True
        suspect = any(self._deaths[chunk] for chunk in worker.chunks)
        return worker.proven and not suspect and len(worker.chunks) < self._room

    def _next_chunk(self, remaining: Iterator[int], *, alone: bool) -> int | None:
        if alone and self._again:
            return self._again.popleft()
        return next(remaining, None)

    def _next_message(self, stop: Stop) -> tuple["_Worker", Any]:
        while True:
            stop.check()
            with contextlib.suppress(Empty):
                return self._messages.get(timeout=POLL_S)

    def _bury(self, worker: "_Worker", end: _End) -> None:
        self._workers.remove(worker)
        worker.end()
        self._again.extend(sorted(worker.chunks))
        if not worker.ready:
            self._false_starts += 1
            if self._false_starts == ATTEMPTS:
                raise ClusterError(
                    f"{ATTEMPTS} worker processes died before they could compute; {end}"
                )
        for chunk in worker.chunks if worker.ready else ():
            self._deaths[chunk] += 1
            if self._deaths[chunk] == ATTEMPTS:
                raise ClusterError(f"{ATTEMPTS} worker processes died on chunk {chunk}; {end}")
        if self._tell is not None:
            which = ", ".join(map(str, sorted(worker.chunks)))
            self._tell(f"a worker process died, {end.how}; another computes chunk {which} again")


class _Worker:
    """A worker process with its chunks, and a thread that reads its replies."""

    def __init__(self, order: WorkerTask, chunk: int, messages: "SimpleQueue[tuple[_Worker, Any]]"):
        self.chunks = {chunk}
        self.ready = self.proven = False
        first = b"".join(pickle.dumps(part) for part in (sys.path, order, chunk))
        try:
            self._process = _start_process()
        except OSError as error:
            raise _start_error(error.strerror or error) from error
        self._to, self._from = cast(IO[bytes], self._process.stdin), self._process.stdout
        self._hearing = threading.Thread(
            target=self._read_replies, args=(first, messages), daemon=True
        )
        try:
            self._hearing.start()
        except RuntimeError as error:
            self._process.kill()
            self._process.communicate()
            raise _start_error(error) from error

    def give(self, chunk: int) -> None:
        """Send another chunk; a worker that finished its first chunk has read all before."""
        self.chunks.add(chunk)
        with contextlib.suppress(OSError):  # the worker died, which the thread reports
            self._to.write(pickle.dumps(chunk))
            self._to.flush()

    def kill(self) -> None:
        self._process.kill()

    def end(self) -> None:
        """End the process and close its pipes."""
        self._process.kill()
        self._process.wait()
        self._hearing.join()
        for stream in (self._to, self._from):
            with contextlib.suppress(OSError):  # unsent data
                cast(IO[bytes], stream).close()

    def _read_replies(self, first: bytes, messages: "SimpleQueue[tuple[_Worker, Any]]") -> None:
        try:
            self._to.write(first)
            self._to.flush()
            while True:
                messages.put((self, pickle.load(cast(IO[bytes], self._from))))
        except (EOFError, OSError, pickle.UnpicklingError):  # perhaps within a message
            pass
        except Exception as error:  # a reply that cannot be unpickled here
            messages.put((self, Failed(error)))
            return
        messages.put((self, _End(self._process.wait())))


def _start_error(reason: object) -> ClusterError:
    return ClusterError(f"no worker process can be started: {reason}")


def _start_process() -> subprocess.Popen[bytes]:
    """Start a worker that Ctrl-C does not reach: its parent ends it in an orderly way."""
    command = [sys.executable, *_interpreter_flags(), "-c", PROGRAM]
    pipe = subprocess.PIPE
    if sys.platform == "win32":
        flags = subprocess.CREATE_NEW_PROCESS_GROUP
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, creationflags=flags)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return subprocess.Popen(command, stdin=pipe, stdout=pipe)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interpreter_flags() -> list[str]:
    """Flags: no imports from the current folder, and environment variables as in this process."""
    same = {"-I": sys.flags.isolated, "-E": sys.flags.ignore_environment}
    same |= {"-s": sys.flags.no_user_site}
    return ["-P", *(flag for flag, value in same.items() if value)]
