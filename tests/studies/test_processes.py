"""Studies as processes: started twice at once, interrupted, killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.store.tables import open_study
from jaxsat.studies.ensemble import _by_column
from jaxsat.studies.executors import Threads
from jaxsat.studies.run import run_study
from studies.stores import contents, same
from studies.studies import tumbling

TESTS = Path(__file__).parents[1]
PATHS = {"PYTHONPATH": os.pathsep.join([str(TESTS.parent), str(TESTS)])}


def begun(*command):
    return subprocess.Popen(
        [sys.executable, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **PATHS},
        start_new_session=True,  # a group of its own, to send signals to
    )


@pytest.mark.slow
def test_killing_a_study_loses_no_finished_chunk(tmp_path):
    """SIGKILL at some instants; then the store is completed and equals one never interrupted."""
    for lines in (3, 40):
        process = begun("-m", "studies.studies", str(tmp_path / "s"))
        told = [process.stdout.readline() for _ in range(lines)]
        process.send_signal(signal.SIGKILL)
        process.communicate()
        done = contents(tmp_path / "s")["status"].sum()
        assert done >= int(told[-1])
    study = tumbling(1200, 8, duration=200.0)
    run_study(study, tmp_path / "s", executor=Threads(2))
    found = contents(tmp_path / "s")
    assert found.pop("status").sum() == 1200
    same(found, _by_column(study.evaluate(np.arange(1200))))


@pytest.mark.slow
def test_of_processes_started_at_once_one_goes_on(tmp_path):
    """The others are told, in words, and change nothing."""
    processes = [begun("-m", "studies.studies", str(tmp_path / "s")) for _ in range(3)]
    deadline = time.monotonic() + 120
    while sum(process.poll() is None for process in processes) > 1:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    (alive,) = (process for process in processes if process.poll() is None)
    alive.send_signal(signal.SIGKILL)
    for process in processes:
        _, error = process.communicate()
        if process is not alive:
            assert "is being written to by another process" in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s"]


SETTINGS = [
    "control.law=coast",
    "simulation.duration_s=500",
    "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=0.1}",
]
COAST = ["paper-rate", "--chunk", "8", "--batch-size", "8"]
COAST += [token for setting in SETTINGS for token in ("--set", setting)]
MAIN = "from jaxsat.cli import main; main()"


def begun_study(store, *more):
    """A study as a command, once its second chunk is done."""
    process = begun("-c", MAIN, "montecarlo", *COAST, "--out", str(store), *more)
    deadline = time.monotonic() + 180
    while not (store / "status" / "c" / "1").exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return process


def same_study(count, engine):
    """The study of the command, here."""
    return build_study(load("paper-rate", SETTINGS), count, engine=engine, batch_size=8, chunk=8)


def assert_ended_as_told(process, store, status):
    """With that one line, and none from the processes that it began."""
    _, error = process.communicate(timeout=30)
    how = {130: "interrupted", 143: "terminated"}[status]
    assert process.returncode == status
    kept = "the finished chunks are in"
    assert f"jaxsat: {how}; {kept} {store}; the same command resumes\n" in error
    assert not [noise for noise in ("Traceback", "leaked", "distributed") if noise in error]


@pytest.mark.slow
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_study_says_what_is_kept(tmp_path, sent, status):
    options = ("--engine", "scan", "-n", "20000", "--workers", "1")
    process = begun_study(tmp_path / "s", *options)
    process.send_signal(sent)
    assert_ended_as_told(process, tmp_path / "s", status)
    done = np.asarray(open_study(tmp_path / "s")["status"])
    assert 16 <= done.sum() < 20000


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "killpg"), reason="needs groups of processes")
def test_ctrl_c_ends_all_processes_of_a_study(tmp_path):
    """SIGINT to the whole group, as from a terminal; resumed, the bits are as if never stopped."""
    store = tmp_path / "s"
    options = ("--engine", "scan", "-n", "256", "--processes", "2")
    process = begun_study(store, *options)
    os.killpg(process.pid, signal.SIGINT)
    assert_ended_as_told(process, store, 130)
    deadline = time.monotonic() + 30
    while running_in_group(process.pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    before = contents(store)["status"].sum()
    assert 8 <= before < 256
    study = same_study(256, "scan")
    run_study(study, store, executor=Threads(2))
    found = contents(store)
    assert found.pop("status").sum() == 256
    same(found, _by_column(study.evaluate(np.arange(256))))


def running_in_group(group):
    """Whether a process of the group is there; one that is dead but not yet buried is not."""
    told = subprocess.run(
        ["ps", "-A", "-o", "pgid=,stat="], capture_output=True, text=True, check=True
    )
    rows = (line.split() for line in told.stdout.splitlines())
    return any(int(number) == group and not state.startswith("Z") for number, state in rows)


@pytest.mark.slow
def test_ctrl_c_ends_a_study_of_machine_code(tmp_path):
    """While the native engine computes; resumed, the bits are as if never stopped."""
    store = tmp_path / "s"
    process = begun_study(store, "--engine", "native", "-n", "4000")
    process.send_signal(signal.SIGINT)
    assert_ended_as_told(process, store, 130)
    assert 8 <= contents(store)["status"].sum() < 4000
    study = same_study(4000, "native")
    chunks = []

    def enough(progress):
        chunks.append(progress.done)
        if len(chunks) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(study, store, executor=Threads(2), report=enough)
    found = contents(store)
    done = np.flatnonzero(found.pop("status"))
    assert len(done) >= 48
    expected = _by_column(study.evaluate(done))
    same({name: values[done] for name, values in found.items()}, expected)


GROWTH = """
import resource, sys, jax
jax.config.update("jax_enable_x64", True)
from jaxsat.studies import Threads, run_study
from studies.studies import tumbling

for count in (4_000, 80_000):
    study = tumbling(count, chunk=2000, batch_size=250, duration=2.0)
    run_study(study, f"{sys.argv[1]}/{count}", executor=Threads(2))
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_number_of_cases(tmp_path):
    """Twenty times the cases, whose results are 15 MB, in less than 25 MB more at the peak."""
    output, error = begun("-c", GROWTH, str(tmp_path)).communicate()
    assert not error
    few, many = map(float, output.split())
    assert many - few < 25
