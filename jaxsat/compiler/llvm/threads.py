"""Threads with stacks of known size, in which machine code is made and runs.

The system's own size may be anything: `ulimit -s`, half a megabyte in a thread of macOS, a caller's
choice. A frame of machine code takes up to some 50 kB in jaxsat's programs, and more in larger ones
(`emitter.LARGEST`); LLVM recurses.
"""

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from jaxsat.core.once import once
from jaxsat.core.process import all_processors

STACK = 16 << 20
"""Bytes of a thread's stack; the system provides those that are used."""

_starting = threading.Lock()

T = TypeVar("T")


def in_threads(work: Callable[[threading.Event], None], workers: int) -> None:
    """Call `work(stopped)` in `workers` of the threads that all callers share.

    There are as many as processors, and callers are served in turn: several at once keep all
    processors busy and no more. An exception of the caller's thread (Ctrl-C) sets `stopped`, and is
    raised once all have returned.
    """
    stopped, futures = threading.Event(), []
    try:
        with _large_stacks():
            pool = _shared(os.getpid())  # a process that was forked has none of its parent's
            for _ in range(workers):
                futures.append(pool.submit(work, stopped))
        for future in futures:
            future.result()
    finally:
        _end(futures, stopped)


def in_own_thread(work: Callable[[threading.Event], T]) -> T:
    """Return the result of `work(stopped)` in a thread of its own; else like `in_threads`."""
    stopped, futures, pool = threading.Event(), [], ThreadPoolExecutor(1, "jaxsat-native-own")
    try:
        with _large_stacks():
            futures.append(pool.submit(work, stopped))
        return futures[0].result()
    finally:
        _end(futures, stopped)
        pool.shutdown()


@once
def _shared(process: int) -> ThreadPoolExecutor:
    del process
    return ThreadPoolExecutor(all_processors(), thread_name_prefix="jaxsat-native")


def _end(futures: Sequence[Future], stopped: threading.Event) -> None:
    stopped.set()
    for future in futures:
        if not future.cancel():
            future.exception()  # waits


@contextmanager
def _large_stacks() -> Iterator[None]:
    """Within this context, new threads have a stack of `STACK` bytes."""
    with _starting:
        before = threading.stack_size(STACK)
        try:
            yield
        finally:
            threading.stack_size(before)
