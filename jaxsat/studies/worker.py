"""A worker process of `jaxsat.studies.processes.Processes`, and messages shared with dask workers.

Work and replies pass through the pipes of its start, standard input and output, which only its
parent process holds. The worker ends when its parent does, however that ends. The messages (work
there, results and failures back) are the same for the workers of a scheduler.
"""

import io
import os
import pickle
import pkgutil
import sys
import threading
import traceback
import warnings
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, NoReturn

import cloudpickle
import equinox as eqx
import jax

from jaxsat.core.process import add_folders, added_folders, share_of
from jaxsat.studies.executors import ClusterError, Work


class PickledWork(NamedTuple):
    """Pickled work, whether the sender computes with 64-bit floats, and the folders of a user's
    modules."""

    work: bytes
    double_precision: bool
    folders: tuple[str, ...] = ()

    def unpacked(self) -> Work:
        """Return the work, after setting JAX to the sender's precision.

        Unpacking before would round arrays to the current precision.
        """
        jax.config.update("jax_enable_x64", self.double_precision)
        add_folders(self.folders)
        return cloudpickle.loads(self.work)


class Done(NamedTuple):
    """A chunk and its result."""

    chunk: int
    result: Any


class Failed(NamedTuple):
    """Exception of the work."""

    error: BaseException


def packed(work: Work) -> PickledWork:
    """Pack work for another process.

    Functions defined by the running program or a notebook are included; modules are imported there.
    Raises `ClusterError` for an equinox module of such a program, which would lose its fields.
    """
    file = io.BytesIO()
    _Pickler(file).dump(work)
    return PickledWork(file.getvalue(), bool(jax.config.read("jax_enable_x64")), added_folders())


class _Pickler(cloudpickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        """Reduce an object as cloudpickle does; refuse one that cannot be rebuilt."""
        if isinstance(obj, type) and issubclass(obj, eqx.Module) and not _is_importable(obj):
            raise ClusterError(
                "what worker processes compute must be defined in a module that they can import, "
                f"got {obj.__qualname__} of {obj.__module__}; put it into a file of its own"
            )
        return cloudpickle.Pickler.reducer_override(self, obj)


def _is_importable(kind: type) -> bool:
    """Whether a worker can import a class from its module."""
    if kind.__module__ == "__main__":
        return False
    try:
        return pkgutil.resolve_name(f"{kind.__module__}:{kind.__qualname__}") is kind
    except (ImportError, AttributeError, ValueError):  # a class inside a function
        return False


def computed(work: Work, chunk: int) -> Done | Failed:
    """Compute a chunk in a worker on one of the processors available to the worker."""
    try:
        with share_of(1):
            return Done(chunk, work(chunk))
    except BaseException as error:
        return failed(error)


def failed(error: BaseException) -> Failed:
    """Return an exception with its traceback, or its message if it cannot be pickled."""
    where = f"In a worker:\n{''.join(traceback.format_exception(error))}"
    try:
        cloudpickle.loads(cloudpickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(where)
    return Failed(error)


class WorkerTask(NamedTuple):
    """Work of a worker, and number of parallel chunks; chunk numbers follow."""

    packed: PickledWork
    threads: int


class Ready(NamedTuple):
    """Report that the worker has imported and unpacked its work."""


def serve() -> NoReturn:
    """Compute the requested chunks until the parent closes the pipe."""
    replies = _Replies()
    warnings.filterwarnings("ignore", "machine code cannot be kept")  # the parent reports it
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
    os._exit(0)  # at once, with its computing threads


def _next_chunk() -> int | None:
    try:
        return pickle.load(sys.stdin.buffer)
    except (EOFError, OSError, pickle.UnpicklingError):  # perhaps within a number
        return None


def _begin(pool: ThreadPoolExecutor, work: Work, chunk: int, replies: "_Replies") -> None:
    try:
        pool.submit(_compute, work, chunk, replies)
    except RuntimeError as error:  # the user's thread limit is reached
        raise ClusterError(f"a worker process cannot start its threads: {error}") from error


class _Replies:
    """Standard output at the start, for replies alone; printed text goes to stderr."""

    def __init__(self):
        self._stream = os.fdopen(os.dup(1), "wb")
        self._lock = threading.Lock()
        try:
            os.dup2(2, 1)
        except OSError:  # no standard error
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def send(self, message: Ready | Done | Failed) -> None:
        """Send a message; raises exceptions of pickling."""
        data = cloudpickle.dumps(message)
        with self._lock:
            try:
                self._stream.write(data)
                self._stream.flush()
            except OSError:
                os._exit(0)  # no reader


def _compute(work: Work, chunk: int, replies: _Replies) -> None:
    try:
        replies.send(computed(work, chunk))
    except Exception as error:  # an unpicklable result
        replies.send(failed(error))
