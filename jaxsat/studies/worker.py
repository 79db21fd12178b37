"""A worker process of `jaxsat.studies.processes.Processes`: it reads what to compute, and answers.

Both go through the pipes that it was started with, standard input and output, which no process but
the one that started it holds. It ends when that one does, however that ends. What goes to and fro
(work there, results and failures back) is the same for the workers of a scheduler.
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
    """Work as bytes, whether the sender computes with 64-bit floats, and where a user's modules
    are."""

    work: bytes
    double_precision: bool
    folders: tuple[str, ...] = ()

    def unpacked(self) -> Work:
        """The work, once JAX is in the sender's precision.

        Unpacking before would round arrays to the precision of the moment.
        """
        jax.config.update("jax_enable_x64", self.double_precision)
        add_folders(self.folders)
        return cloudpickle.loads(self.work)


class Done(NamedTuple):
    """A chunk and its result."""

    chunk: int
    result: Any


class Failed(NamedTuple):
    """What the work raised."""

    error: BaseException


def packed(work: Work) -> PickledWork:
    """Work for another process.

    Functions that the running program or a notebook defines go along; modules are imported there.
    Raises `ClusterError` for an equinox module of such a program, which would lose its fields.
    """
    file = io.BytesIO()
    _Pickler(file).dump(work)
    return PickledWork(file.getvalue(), bool(jax.config.read("jax_enable_x64")), added_folders())


class _Pickler(cloudpickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        """Reduce an object as cloudpickle does; refuse what could not be rebuilt."""
        if isinstance(obj, type) and issubclass(obj, eqx.Module) and not _is_importable(obj):
            raise ClusterError(
                "what worker processes compute must be defined in a module that they can import, "
                f"got {obj.__qualname__} of {obj.__module__}; put it into a file of its own"
            )
        return cloudpickle.Pickler.reducer_override(self, obj)


def _is_importable(kind: type) -> bool:
    """Whether a worker finds a class where it says that it is."""
    if kind.__module__ == "__main__":
        return False
    try:
        return pkgutil.resolve_name(f"{kind.__module__}:{kind.__qualname__}") is kind
    except (ImportError, AttributeError, ValueError):  # a class inside of a function
        return False


def computed(work: Work, chunk: int) -> Done | Failed:
    """A chunk, computed in a worker on one of the processors that the worker may use."""
    try:
        with share_of(1):
            return Done(chunk, work(chunk))
    except BaseException as error:
        return failed(error)


def failed(error: BaseException) -> Failed:
    """An exception with where it was raised, or what it says where it cannot be pickled."""
    where = f"In a worker:\n{''.join(traceback.format_exception(error))}"
    try:
        cloudpickle.loads(cloudpickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(where)
    return Failed(error)


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
