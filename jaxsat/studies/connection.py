"""A connection to a dask scheduler: made in time, to one of the same versions, or refused."""

import platform
import threading
import warnings
from collections.abc import Callable
from concurrent.futures import Future as Answer
from contextlib import suppress
from importlib.metadata import version
from typing import Any, TypeVar, cast

from distributed import Client
from distributed.versions import VersionMismatchWarning

from jaxsat.studies.executors import ClusterError

ANSWER_S = 30.0
"""How long a scheduler may take for any other answer."""

PARTING_S = 3.0
"""How long taking leave of a scheduler may take."""

T = TypeVar("T")


def connected(address: str, timeout: float) -> Client:
    """A client of the scheduler at an address.

    Raises `ClusterError` where none answers within `timeout` seconds, or one of other versions.
    """

    def connect() -> Client:
        with warnings.catch_warnings():  # versions are compared below
            warnings.simplefilter("ignore", VersionMismatchWarning)
            return Client(address, timeout=timeout, set_as_default=False)

    try:
        client = in_time(connect, timeout + 1.0)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address}: {reason(error)}") from error
    except Exception as error:  # whatever dask makes of what is there
        raise ClusterError(
            f"no scheduler at {address} can be used by dask {version('dask')}: {reason(error)}"
        ) from error
    loop = cast(Any, client.loop).asyncio_loop
    loop.set_exception_handler(lambda *_: None)  # of tasks that nobody waits for any longer
    try:
        _require_same_versions(client, address)
    except BaseException:
        with suppress(Exception):
            in_time(client.close, PARTING_S)
        raise
    return client


def _require_same_versions(client: Client, address: str) -> None:
    """Raise `ClusterError` where a scheduler has other versions, with which it may not answer."""
    here = {name: version(name) for name in ("dask", "distributed")}
    here["python"] = platform.python_version()
    try:
        ask = cast(Any, client.scheduler).versions
        told = in_time(lambda: cast(Any, client.sync(ask)), ANSWER_S)
        there = {name: str(told["packages"][name]) for name in here}
    except Exception as error:
        message = f"the scheduler at {address} tells no versions: {reason(error)}"
        raise ClusterError(message) from error
    other = [
        f"{name}: {there[name]} there, {here[name]} here"
        for name in here
        if _release(name, there[name]) != _release(name, here[name])
    ]
    if other:
        raise ClusterError(
            f"the scheduler at {address} must have the same versions ({'; '.join(other)})"
        )


def _release(name: str, number: str) -> str:
    """Of Python 3.11.7 the 3.11, of others all."""
    return ".".join(number.split(".")[:2]) if name == "python" else number


def in_time(question: Callable[[], T], limit: float) -> T:
    """An answer within a number of seconds, or `TimeoutError`; not all of dask's own have one."""
    answer = Answer[T]()

    def target() -> None:
        try:
            answer.set_result(question())
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=target, daemon=True).start()
    return answer.result(limit)


def reason(error: BaseException) -> str:
    """What an error says, in one line."""
    silent = "no answer in time" if isinstance(error, TimeoutError) else type(error).__name__
    return " ".join(str(error).split()) or silent
