"""Benchmarks run; how fast they are is not tested."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jaxsat.control.diagnosis import average_run_length

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_engines_are_compared_at_equal_accuracy(tmp_path):
    """A few cases for a few seconds, of an engine and a loop written by hand."""
    pytest.importorskip("numba")
    command = [sys.executable, "benchmarks/engines.py", "--cases", "1", "3", "--duration", "2"]
    command += ["--rounds", "1", "--truth", "3", "--cold-cases", "2"]
    command += ["--only", "native, Dopri8", "lax.scan", "--json", str(tmp_path / "found.json")]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads((tmp_path / "found.json").read_text())
    names = {"jaxsat native, Dopri8 adaptive", "lax.scan by hand, RK4"}
    for kind in ("accuracy", "cold"):
        assert found[kind].keys() == names
    assert found["accuracy"]["jaxsat native, Dopri8 adaptive"]["error"] <= 1e-6
    assert {count: row.keys() for count, row in found["rows"].items()} == {"1": names, "3": names}
    assert all(entry["peak_MB"] > entry["own_MB"] > 0 for entry in found["cold"].values())
    lines = done.stdout.splitlines()
    assert sum(line.startswith("| ") for line in lines) == 5


@pytest.mark.slow
def test_a_campaign_of_kills_finds_no_fault(tmp_path):
    """A study is killed, resumed and equal to one never disturbed; all of it is counted."""
    command = [sys.executable, "benchmarks/kill_campaign.py", "--kills", "1", "--seed", "2"]
    done = subprocess.run(
        [*command, "--only", "montecarlo, native"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    heading, _, row = done.stdout.splitlines()[-3:]
    found = dict(zip(heading.split(" | "), row.split(" | "), strict=True))
    assert int(found["kills"]) >= 1
    assert int(found["equal"]) >= 1
    assert found["faults |"] == "0 |"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_false_alarms_are_counted_of_wheels_too():
    """Three wheels of four are in use, with three tests each; nothing fails."""
    command = [sys.executable, "benchmarks/false_alarms.py", "--cases", "2"]
    command += ["--scenario", "failures-telescope", "--set", "simulation.duration_s=20"]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    lines = done.stdout.splitlines()
    assert "2 of 2 cases, 0 false alarms" in lines
    assert "9 tests, 3 of each actuator that is in use" in lines
    level, _, expected = lines[-1].split()
    scores = 9 * 56770 / float(expected)
    assert scores == pytest.approx(average_run_length(1.0, float(level)), rel=0.01)


@pytest.mark.slow
def test_a_torque_from_outside_is_counted_as_no_failure():
    """Four cases in which nothing fails and eight with a failure, at 1 % of a thruster's torque."""
    command = [sys.executable, "benchmarks/model_errors.py", "--cases", "4", "--torque", "0.01"]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines()[-1].split() == ["torque", "1%", "4", "0", "0", "0", "8", "0"]
