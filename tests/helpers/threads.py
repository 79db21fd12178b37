"""Threads that begin at one instant."""

import inspect
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

COUNT = 20


def at_once(work, count=COUNT):
    """What `work()` returns in each of so many threads that come to it together.

    An exception of one is raised.
    """
    barrier = threading.Barrier(count)

    def come():
        barrier.wait(60)
        return work()

    with ThreadPoolExecutor(count) as pool:
        futures = [pool.submit(come) for _ in range(count)]
        return [future.result() for future in futures]


def one(found):
    """The one object that all threads were given."""
    first, *rest = found
    assert all(other is first for other in rest)
    return first


def made_once(work, function):
    """The one object that `work()` gives in all threads, for which `function` is called once.

    The function takes its time, so that all the others come meanwhile.
    """
    code, calls = inspect.unwrap(function).__code__, []

    def slowed(frame, event, argument):
        if event == "call" and frame.f_code is code:
            calls.append(argument)
            time.sleep(0.02)

    def watched():
        sys.setprofile(slowed)
        try:
            return work()
        finally:
            sys.setprofile(None)

    found = one(at_once(watched))
    assert len(calls) == 1
    return found
