"""Strict settings for every test: 64-bit floats, no silent rank promotion, shapes checked.

All processes of a run share what they compile: XLA's programs and jaxsat's kernels are kept in
one folder that ends with the run, unless `JAX_COMPILATION_CACHE_DIR` names one that outlives it.
Bytecode is kept beside the sources, as Python does by default.
"""

import atexit
import ctypes
import gc
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path

import pytest

from helpers import compiling, tools

SHARED_COMPILATIONS = {
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.2",
    "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
    "EQX_ON_ERROR": "nan",  # a program that calls back into Python is never kept
}


def _share_compilations() -> None:
    """Keep compiled programs for the run; to be called before JAX is imported."""
    for name, value in SHARED_COMPILATIONS.items():
        os.environ.setdefault(name, value)
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        folder = tempfile.mkdtemp(prefix="jaxsat-tests-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["JAX_COMPILATION_CACHE_DIR"] = folder


def _keep_bytecode() -> None:
    """Let hundreds of processes read what the first one compiled, whatever the environment says."""
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


_keep_bytecode()
compiling.skip_most_optimisations()
_share_compilations()

pytest.register_assert_rewrite("scenario.mistakes", "compiler.rule_checks")


def pytest_configure(config):
    """Set up the processes that run tests; xdist's controller only gives tests out."""
    if not getattr(config.option, "numprocesses", None):
        _set_up(config)


def _set_up(config) -> None:
    import jax
    from hypothesis import settings

    from helpers import typechecking

    compiling.share_contexts()
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_numpy_rank_promotion", "raise")
    if config.option.markexpr != "slow":  # they cost 6 %; quick tests call the same functions
        typechecking.install()
    # Tracing makes objects by the million, few of them in circles.
    gc.set_threshold(200_000, 50, 50)
    settings.register_profile("jaxsat", deadline=None, max_examples=50, derandomize=True)
    settings.load_profile("jaxsat")


# In a shell's background job or under nohup, programs started by tests would ignore these as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

SHARING = ("tests/synthesis/tuning/",)
"""Folders whose files share what is dear to make."""

FIRST = (
    *("tests/synthesis/tuning/", "tests/control/test_planned.py", "tests/cli/test_compare.py"),
    *("tests/flight/test_strangers.py", "tests/cli/test_front.py", "tests/cli/test_montecarlo.py"),
    "tests/simulation/test_wheels_failing_continuously.py",
    "tests/synthesis/controller_design/test_design.py",
    "tests/flight/test_software_in_the_loop.py",
    *("tests/scenario/test_plugin_parts.py", "tests/cli/test_your_own_law.py"),
    *("tests/report/reproduction/test_claims.py", "tests/control/test_fault_tolerant.py"),
    *("tests/studies/test_recovery.py", "tests/studies/test_processes.py"),
    *("tests/test_benchmarks.py", "tests/scenario/test_plugins.py", "tests/test_heyoka.py"),
    "tests/test_distribution.py",
    *("tests/control/test_hybrid_wheels.py", "tests/control/test_similarity.py"),
    "tests/simulation/engine/test_gradients.py",
    "tests/simulation/engine/test_wheel_failures.py",
    *("tests/simulation/engine/test_magnetorquers.py", "tests/simulation/engine/test_wheels.py"),
    *("tests/simulation/test_failing_ideal_thrusters.py", "tests/spacecraft/test_allocation.py"),
    "tests/synthesis/verification/test_verification.py",
    *("tests/simulation/engine/native/test_kernel_store.py", "tests/cli/test_docs.py"),
    *("tests/control/navigation/test_dispersed_sensors.py", "tests/cli/test_fuzz.py"),
    *("tests/studies/test_torque_ranges.py", "tests/spacecraft/environment/test_igrf.py"),
)
"""Groups with the slowest tests (`.ci/run` ends with a list). They begin first, then those of many
tests, so that no process works alone at the end."""


def _group(nodeid: str) -> str:
    file = nodeid.split("::")[0]
    return next((folder for folder in SHARING if file.startswith(folder)), file)


def pytest_collection_modifyitems(config, items):
    """In a process of several: in the order in which groups are handed out."""
    if hasattr(config, "workerinput"):
        counts = Counter(_group(item.nodeid) for item in items)
        places = {group: place - len(FIRST) for place, group in enumerate(FIRST)}
        ranks = {group: (places.get(group, 0), -count, group) for group, count in counts.items()}
        items.sort(key=lambda item: ranks[_group(item.nodeid)])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """With `--dist loadgroup` the groups are files: what the tests of one share is made once.

    Marks of groups would not do: xdist 3.8 writes them into names that pytest 9.2 does not read.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            return _group(nodeid)

    config.option.loadscopereorder = False  # the order is that of the items
    return ByFile(config, log) if config.getvalue("dist") == "loadgroup" else None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup():
    """Check the first calls of every test, those of its fixtures among them."""
    from helpers import typechecking

    typechecking.begin_test()


MAX_MEMORY, MIN_GAIN = 4 * 2**30, 2**30
"""Bytes of a process of tests from which on it drops the compiled programs of tests past, and how
much it must have grown since the last time."""

_left = 0


@pytest.fixture(autouse=True)
def _programs_do_not_fill_the_memory():
    global _left
    yield
    if sys.platform == "linux" and _resident() > max(MAX_MEMORY, _left + MIN_GAIN):
        import jax

        jax.clear_caches()
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)
        _left = _resident()


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def pytest_terminal_summary(terminalreporter):
    """Count the tests that did not run for want of a tool."""
    skipped = terminalreporter.stats.get("skipped", [])
    for name, count in sorted(tools.missing_in(report.longrepr for report in skipped).items()):
        terminalreporter.write_line(f"{count} skipped: {name} is not installed")


def pytest_sessionfinish(session):
    """Fail if a tool that `JAXSAT_TOOLS` names is not there: its tests would not run in silence."""
    absent = tools.absent_of_required()
    if absent and not hasattr(session.config, "workerinput"):
        print(f"\nJAXSAT_TOOLS names tools that are not installed: {', '.join(absent)}")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
