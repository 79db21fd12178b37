"""Strict settings for every test: 64-bit floats, no silent rank promotion, shapes checked."""

import ctypes
import gc
import signal
import sys
from pathlib import Path

import jax
import pytest
from jaxtyping import install_import_hook

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

install_import_hook("jaxsat", "beartype.beartype")

# In a shell's background job or under nohup, programs started by tests would ignore these as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

MAX_MEMORY, MIN_GAIN = 4 * 2**30, 2**30
"""Bytes of a process of tests from which on it drops the compiled programs of tests past, and how
much it must have grown since the last time."""

_left = 0


@pytest.fixture(autouse=True)
def _programs_do_not_fill_the_memory():
    global _left
    yield
    if sys.platform == "linux" and _resident() > max(MAX_MEMORY, _left + MIN_GAIN):
        jax.clear_caches()
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)
        _left = _resident()


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
