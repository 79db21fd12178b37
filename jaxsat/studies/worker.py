"""A worker process of `jaxsat.studies.Processes`: it reads what to compute, and answers.

Both go through the pipes that it was started with, standard input and output, which no process but
the one that started it holds. It ends when that one does, however that ends.
"""

import os
import pickle
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, NoReturn

import cloudpickle

from jaxsat.studies.executors import ClusterError, Work
from jaxsat.studies.shipping import Done, Failed, PickledWork, computed, failed


class WorkerTask(NamedTuple):
    """What a worker is to compute, and how many chunks at once; numbers of chunks follow."""

    packed: PickledWork
    threads: int


class Ready(NamedTuple):
    """The worker has imported and unpacked what it needs."""


def serve() -> NoReturn:
    """Compute the chunks that are asked for until nobody asks any longer."""
    replies = _Replies()
    warnings.filterwarnings("ignore", "machine code cannot be kept")  # who started it tells that
    try:
        order: WorkerTask = pickle.load(sys.stdin.buffer)
        work = order.packed.unpacked()
        pool = ThreadPoolExecutor(order.threads)
        replies.send(Ready())
        while (chunk := _next_chunk()) is not None:
            _begin(pool, work, chunk, replies)
    except BaseException as error:
        replies.send(failed(error))
        os._exit(1)
    os._exit(0)  # at once, with the threads that compute


def _next_chunk() -> int | None:
    """What is asked for next; None where who asked has gone."""
    try:
        return pickle.load(sys.stdin.buffer)
    except (EOFError, OSError, pickle.UnpicklingError):  # in the middle of a number, perhaps
        return None


def _begin(pool: ThreadPoolExecutor, work: Work, chunk: int, replies: "_Replies") -> None:
    try:
        pool.submit(_compute, work, chunk, replies)
    except RuntimeError as error:  # the user has as many as are allowed
        raise ClusterError(f"a worker process cannot start its threads: {error}") from error


class _Replies:
    """Standard output as it was at the start, for answers alone; what is printed goes to stderr."""

    def __init__(self):
        self._stream = os.fdopen(os.dup(1), "wb")
        self._lock = threading.Lock()
        try:
            os.dup2(2, 1)
        except OSError:  # there is no standard error
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def send(self, message: Ready | Done | Failed) -> None:
        """Send a message; raises what pickling it raises."""
        data = cloudpickle.dumps(message)
        with self._lock:
            try:
                self._stream.write(data)
                self._stream.flush()
            except OSError:
                os._exit(0)  # nobody reads


def _compute(work: Work, chunk: int, replies: _Replies) -> None:
    try:
        replies.send(computed(work, chunk))
    except Exception as error:  # a result that cannot be pickled
        replies.send(failed(error))
