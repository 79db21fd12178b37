"""Studies as processes: started twice at once, interrupted, killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jaxsat.montecarlo import Threads, run_study
from jaxsat.montecarlo.ensemble import _by_column
from jaxsat.results import open_study
from montecarlo.studies import tumbling
from montecarlo.test_ensemble import contents, same

TESTS = Path(__file__).parents[1]
PATHS = {"PYTHONPATH": os.pathsep.join([str(TESTS.parent), str(TESTS)])}


def begun(*command):
    return subprocess.Popen(
        [sys.executable, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **PATHS},
    )


@pytest.mark.slow
def test_killing_a_study_loses_no_finished_chunk(tmp_path):
    """SIGKILL at some instants; then the store is completed and equals one never broken off."""
    for lines in (3, 40):
        process = begun("-m", "montecarlo.studies", str(tmp_path / "s"))
        told = [process.stdout.readline() for _ in range(lines)]
        process.send_signal(signal.SIGKILL)
        process.communicate()
        done = contents(tmp_path / "s")["status"].sum()
        assert done >= int(told[-1])
    study = tumbling(4000, 8, duration=200.0)
    run_study(study, tmp_path / "s", executor=Threads(2))
    found = contents(tmp_path / "s")
    assert found.pop("status").sum() == 4000
    same(found, _by_column(study.evaluate(np.arange(4000))))


@pytest.mark.slow
def test_of_processes_started_at_once_one_goes_on(tmp_path):
    """The others are told, in words, and change nothing."""
    processes = [begun("-m", "montecarlo.studies", str(tmp_path / "s")) for _ in range(3)]
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


COAST = [
    "paper-rate",
    *("--set", "control.law=coast"),
    *("--set", "simulation.duration_s=500"),
    *("--set", "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=0.1}"),
    *("--engine", "scan", "--chunk", "8", "--width", "8", "-n", "20000", "--workers", "1"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_study_says_what_is_kept(tmp_path, sent, status):
    main = "from jaxsat.cli import main; main()"
    process = begun("-c", main, "montecarlo", *COAST, "--out", str(tmp_path / "s"))
    deadline = time.monotonic() + 120
    while not (tmp_path / "s" / "status" / "c" / "1").exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(sent)
    _, error = process.communicate(timeout=20)
    assert process.returncode == status
    kept = "the chunks that are done are in"
    assert f"{kept} {tmp_path / 's'}; the same command goes on from there" in error
    assert "Traceback" not in error
    done = np.asarray(open_study(tmp_path / "s")["status"])
    assert 16 <= done.sum() < 20000


GROWTH = """
import resource, sys, jax
jax.config.update("jax_enable_x64", True)
from jaxsat.montecarlo import Threads, run_study
from montecarlo.studies import tumbling

for count in (4_000, 80_000):
    study = tumbling(count, chunk=2000, lanes=250, duration=2.0)
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
