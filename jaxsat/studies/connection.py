"""Connection to a dask scheduler within a time limit; other versions are refused.

The scheduler is located by its address, or by the JSON file that it wrote.
"""

import os
import platform
import re
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Future as Answer
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

from distributed import Client
from distributed.versions import VersionMismatchWarning

from jaxsat.store.files import parse_json, read_or_explain
from jaxsat.studies.executors import ClusterError

FLUSHED_S = 1.0
"""Time limit, s, for a scheduler to write its file in full."""

EXAMPLE = "tcp://host:8786"
ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://\S+|[^\s/]+:[0-9]+")
"""Addresses with any protocol that dask knows, or without one."""


def scheduler_address(place: str, timeout: float) -> str:
    """Return the address of the scheduler at `place`, which is an address or a scheduler's file.

    An absent file is awaited for `timeout` seconds. Raises `ValueError` if there is none then, or
    the file is invalid, and `OutputError` for one that cannot be read.
    """
    if not os.path.exists(place):
        if ADDRESS.fullmatch(place):
            return place
        if not place.endswith(".json"):
            raise ValueError(
                f"A scheduler must be an address such as {EXAMPLE} or the JSON file that it "
                f"wrote, but got {place!r}."
            )
    start = time.monotonic()
    while True:
        document = parse_json(read_or_explain(Path(os.path.realpath(place))))
        address = document.get("address") if isinstance(document, dict) else None
        if isinstance(address, str) and ADDRESS.fullmatch(address):
            return address
        limit, reason = timeout, f"there is none after {timeout:g} s"
        if os.path.exists(place):
            limit, reason = FLUSHED_S, f"it must have the key `address`, such as {EXAMPLE}"
        if time.monotonic() - start >= limit:
            raise ValueError(f"The scheduler's file {place!r} cannot be used: {reason}.")
        time.sleep(0.1)


ANSWER_S = 30.0
"""Time limit, s, for any other answer of a scheduler."""

PARTING_S = 3.0
"""Time limit, s, for closing the connection to a scheduler."""

T = TypeVar("T")


def connected(address: str, timeout: float) -> Client:
    """Return a client of the scheduler at an address.

    Raises `ClusterError` if no scheduler of the same versions answers within `timeout` seconds.
    """

    def connect() -> Client:
        with warnings.catch_warnings():  # versions are compared below
            warnings.simplefilter("ignore", VersionMismatchWarning)
            return Client(address, timeout=timeout, set_as_default=False)

    try:
        client = in_time(connect, timeout + 1.0)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address}: {reason(error)}") from error
    except Exception as error:  # any error of dask about the server at this address
        raise ClusterError(
            f"no scheduler at {address} can be used by dask {version('dask')}: {reason(error)}"
        ) from error
    loop = cast(Any, client.loop).asyncio_loop
    loop.set_exception_handler(lambda *_: None)  # errors of abandoned tasks
    try:
        _require_same_versions(client, address)
    except BaseException:
        with suppress(Exception):
            in_time(client.close, PARTING_S)
        raise
    return client


def _require_same_versions(client: Client, address: str) -> None:
    """Raise `ClusterError` for a scheduler of other versions, with which communication may fail."""
    local = {name: version(name) for name in ("dask", "distributed")}
    local["python"] = platform.python_version()
    try:
        ask = cast(Any, client.scheduler).versions
        report = in_time(lambda: cast(Any, client.sync(ask)), ANSWER_S)
        remote = {name: str(report["packages"][name]) for name in local}
    except Exception as error:
        message = f"the scheduler at {address} reports no versions: {reason(error)}"
        raise ClusterError(message) from error
    mismatches = [
        f"{name}: {remote[name]} there, {local[name]} here"
        for name in local
        if _release(name, remote[name]) != _release(name, local[name])
    ]
    if mismatches:
        raise ClusterError(
            f"the scheduler at {address} must have the same versions ({'; '.join(mismatches)})"
        )


def _release(name: str, number: str) -> str:
    """Part of a version that must agree: 3.11 of Python 3.11.7, all of other packages."""
    return ".".join(number.split(".")[:2]) if name == "python" else number


def in_time(question: Callable[[], T], limit: float) -> T:
    """Return an answer, or raise `TimeoutError` after `limit` seconds, which dask lacks in part."""
    answer = Answer[T]()

    def target() -> None:
        try:
            answer.set_result(question())
        except BaseException as error:
            answer.set_exception(error)

    threading.Thread(target=target, daemon=True).start()
    return answer.result(limit)


def reason(error: BaseException) -> str:
    """Message of an error, in one line."""
    silent = "no answer in time" if isinstance(error, TimeoutError) else type(error).__name__
    return " ".join(str(error).split()) or silent
