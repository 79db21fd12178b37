"""Process-wide state: available processors, import folders of a user, garbage collection."""

import gc
import math
import os
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path

from jaxsat.core.once import holding

QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""Linux file with the CPU quota of a container: microseconds of computing in a period, or max."""

_share: ContextVar[int | None] = ContextVar("share", default=None)


def processors() -> int:
    """Return the number of available processors: all, or the share inside `share_of`."""
    share = _share.get()
    return all_processors() if share is None else share


def all_processors() -> int:
    """Return the number of processors of this process, at least one.

    Those of the machine, fewer where the process is bound to some of them (by a batch system or
    `taskset`) or is in a container with a quota.
    """
    affinity = getattr(os, "sched_getaffinity", None)
    count = len(affinity(0)) if affinity else os.cpu_count() or 1
    return min(count, _quota() or count)


def share_of(count: int) -> AbstractContextManager[None]:
    """Limit `processors` to `count` inside the `with` block: the rest is in use elsewhere."""
    if count < 1:
        raise ValueError(f"Argument `count` must be at least 1, but got {count}.")
    return holding(_share, count)


def _quota() -> int | None:
    """Return the container's quota in whole processors, rounded up; None without a quota."""
    try:
        most, period = QUOTA.read_text().split()
        return max(1, math.ceil(int(most) / int(period)))
    except (OSError, ValueError):  # no such file, or the word max
        return None


_switching = threading.Lock()


@contextmanager
def no_collection() -> Iterator[None]:
    """Disable garbage collection inside the `with` block.

    The collector would scan all objects again and again while many are made.
    """
    with _switching:
        active = gc.isenabled()
        gc.disable()
    try:
        yield
    finally:
        if active:  # other blocks still inside only get slower
            with _switching:
                gc.enable()


_ADDED: list[str] = []
_adding = threading.Lock()


def add_folders(folders: Iterable[str]) -> None:
    """Add folders to the module search path, after all others."""
    with _adding:
        for folder in folders:
            if folder not in _ADDED:
                _ADDED.append(folder)
            if folder not in sys.path:
                sys.path.append(folder)


def added_folders() -> tuple[str, ...]:
    """Return the folders that have been added, for workers to add them too."""
    return tuple(_ADDED)
