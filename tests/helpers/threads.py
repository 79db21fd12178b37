"""Threads that begin at one instant."""

import sys
import threading
from concurrent.futures import ThreadPoolExecutor

COUNT = 20


def at_once(work, count=COUNT):
    """What `work()` returns in each of so many threads that come to it together.

    They take turns as often as Python lets them. An exception of one is raised.
    """
    barrier, before = threading.Barrier(count), sys.getswitchinterval()

    def come():
        barrier.wait(60)
        return work()

    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(count) as pool:
            futures = [pool.submit(come) for _ in range(count)]
            return [future.result() for future in futures]
    finally:
        sys.setswitchinterval(before)


def one(found):
    """The one object that all threads were given."""
    first, *rest = found
    assert all(other is first for other in rest)
    return first
