"""Strict settings for every test: 64-bit floats, no silent rank promotion, shapes checked."""

import ctypes
import gc
import signal
import sys
from pathlib import Path

import jax
import pytest
from hypothesis import settings

from helpers import typechecking

pytest.register_assert_rewrite("scenario.mistakes", "engine.native.rule_checks")

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")

typechecking.install()

settings.register_profile("jaxsat", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("jaxsat")

# In a shell's background job or under nohup, programs started by tests would ignore these as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

SHARING = ("tests/tuning/",)
"""Folders whose files share what is dear to make."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """With `--dist loadgroup` the groups are files: what the tests of one share is made once.

    Marks of groups would not do: xdist 3.8 writes them into names that pytest 9.2 does not read.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            file = nodeid.split("::")[0]
            return next((folder for folder in SHARING if file.startswith(folder)), file)

    return ByFile(config, log) if config.getvalue("dist") == "loadgroup" else None


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
