"""Computing under the command line: 64-bit floats, and Ctrl-C that works while XLA runs."""

import contextlib
import gc
import importlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import TypeVar, cast

Result = TypeVar("Result")


def use_double_precision() -> None:
    """Switch JAX to 64-bit floats, as every command that computes does first.

    JAX is not imported for it: a mistake in a scenario is reported before.
    """
    os.environ["JAX_ENABLE_X64"] = "1"
    if "jax" in sys.modules:
        sys.modules["jax"].config.update("jax_enable_x64", True)


def interruptibly(work: Callable[[], Result], *, brief: bool = False) -> Result:
    """Do the work in a thread, so that a signal need not wait for compiled code to return.

    While `brief` work is done, as a single run, nobody searches for dead cycles either.
    """
    if not (gc.isenabled() or brief):  # commands start without that search
        gc.freeze()
        gc.enable()
    return _in_a_thread(work)


def import_interruptibly(*modules: str) -> None:
    """Import in a thread: an exception of a signal inside JAX's own import becomes another one."""
    _in_a_thread(lambda: [importlib.import_module(module) for module in modules])


def _in_a_thread(work: Callable[[], Result]) -> Result:
    outcome: list[Result] = []
    failure: list[BaseException] = []

    def target() -> None:
        try:
            outcome.append(work())
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=target, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(0.1)
    if failure:
        raise failure[0]
    return outcome[0]


@contextlib.contextmanager
def dask_unseen() -> Iterator[None]:
    """Hide dask from xarray, which imports all of it where it is installed, to label one array.

    Nothing is hidden where a part of a user's own has imported either.
    """
    hidden = not {"dask", "xarray"} & sys.modules.keys()
    if hidden:
        sys.modules["dask"] = cast(ModuleType, None)  # which Python takes for: there is none
    try:
        yield
    finally:
        if hidden:
            del sys.modules["dask"]
