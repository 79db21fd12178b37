"""Work for worker processes to do and to die of; imported there by name."""

import os
import signal
import sys
import time
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp

from jaxsat.compiler.llvm import cache
from jaxsat.core.process import processors


def told(chunk):
    """Who computes, in which precision, on how many processors."""
    print("a word of the work", flush=True)
    cache._tell(OSError("no home folder is known"))
    return os.getpid(), str(jnp.ones(1).dtype), processors(), chunk


class Deadly(NamedTuple):
    """Work whose process is killed on some chunks, as often as said."""

    notes: Path
    chunks: tuple[int, ...]
    deaths: int
    how: int = signal.SIGKILL

    def __call__(self, chunk):
        with (self.notes / f"{chunk}").open("a") as file:
            file.write(f"{os.getpid()}\n")
        if chunk in self.chunks and self.begun(chunk) <= self.deaths:
            os.kill(os.getpid(), self.how)
        time.sleep(0.02)
        return chunk * chunk

    def begun(self, chunk):
        """How often a chunk was begun."""
        return len((self.notes / f"{chunk}").read_text().split())


def deaf(chunk):
    """Takes so long that nobody waits for it."""
    time.sleep(1000.0)


class Odd(Exception):
    """Cannot be made again from what it is pickled as."""

    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def fails(chunk):
    if chunk == 1:
        raise Odd("this", "that")
    if chunk == 2:
        raise KeyError("two")
    if chunk == 3:
        return lambda: sys.stdin.buffer.raw  # which can be pickled, and
    if chunk == 4:
        return sys.stdin.buffer  # which cannot
    if chunk == 5:
        sys.exit("enough")
    return chunk


class _Work:
    def __call__(self, chunk):
        return chunk


class NotHere(_Work):
    """Work that cannot be unpacked where the name of its module means nothing."""

    def __reduce__(self):
        return __import__, ("a_module_that_is_nowhere",)


class EndsAtOnce(_Work):
    """Work whose unpacking ends the process."""

    def __reduce__(self):
        return os._exit, (3,)
