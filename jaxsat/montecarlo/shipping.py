"""What goes between this process and a worker: work there, results and failures back."""

import traceback
from typing import Any, NamedTuple

import cloudpickle
import jax

from jaxsat.montecarlo.executors import Work
from jaxsat.processors import share_of
from jaxsat.search_path import add_folders, added_folders


class Packed(NamedTuple):
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


def packed(work: Work) -> Packed:
    """Work for another process.

    What the running program or a notebook defines goes along; modules are imported there.
    """
    return Packed(cloudpickle.dumps(work), bool(jax.config.read("jax_enable_x64")), added_folders())


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
