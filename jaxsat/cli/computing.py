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

    JAX is not imported for it: a mistake in a scenario is reported earlier.
    """
    os.environ["JAX_ENABLE_X64"] = "1"
    if "jax" in sys.modules:
        sys.modules["jax"].config.update("jax_enable_x64", True)


def interruptibly(work: Callable[[], Result], *, brief: bool = False) -> Result:
    """Do the work in a thread, so that a signal need not wait for compiled code to return.

    `brief` work, such as a single run or an export, also keeps garbage collection off.
    """
    if not (gc.isenabled() or brief):  # commands start without garbage collection
        gc.freeze()
        gc.enable()
    return _in_a_thread(work)


def import_interruptibly(*modules: str) -> None:
    """Import in a thread: a signal's exception inside JAX's own import becomes another one."""
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

    Nothing is hidden where a user's own part has imported either.
    """
    hidden = not {"dask", "xarray"} & sys.modules.keys()
    if hidden:
        sys.modules["dask"] = cast(ModuleType, None)  # Python takes it as not installed
    try:
        yield
    finally:
        if hidden:
            del sys.modules["dask"]
