"""What goes between this process and a worker: work there, results and failures back."""

import io
import pkgutil
import traceback
from typing import Any, NamedTuple

import cloudpickle
import equinox as eqx
import jax

from jaxsat.core.processors import share_of
from jaxsat.core.search_path import add_folders, added_folders
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
        """As cloudpickle has it, but for what it cannot rebuild."""
        if isinstance(obj, type) and issubclass(obj, eqx.Module) and not _is_found(obj):
            raise ClusterError(
                "what worker processes compute must be defined in a module that they can import, "
                f"got {obj.__qualname__} of {obj.__module__}; put it into a file of its own"
            )
        return cloudpickle.Pickler.reducer_override(self, obj)


def _is_found(kind: type) -> bool:
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
