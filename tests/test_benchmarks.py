"""Benchmarks run; how fast they are is not tested."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from jaxsat.control.diagnosis.diagnosis import average_run_length

ROOT = Path(__file__).parents[1]


def lines_of(name, *options, **environment):
    """What a benchmark prints in a process of its own."""
    command = [sys.executable, f"benchmarks/{name}.py", *map(str, options)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


@pytest.fixture
def lines_here(monkeypatch, capsys):
    """A function that runs a benchmark in this process and returns what it prints."""

    def run(name, *options):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, options)])
        importlib.import_module(name).main()
        return capsys.readouterr().out.splitlines()

    return run


@pytest.mark.slow
def test_engines_are_compared_at_equal_accuracy(lines_here, monkeypatch, tmp_path):
    """A few cases for a few seconds, of an engine and a loop written by hand; one of them cold."""
    pytest.importorskip("numba")
    import engines

    monkeypatch.setattr(engines, "TURN", 1e-3)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    options = ["--duration", 2, "--rounds", 1, "--truth", 3, "--only", "native, Dopri8", "lax.scan"]
    warm, cold = tmp_path / "warm.json", tmp_path / "cold.json"
    told = lines_here("engines", "--cases", 1, 3, *options, "--warm", "--json", warm)
    found = json.loads(warm.read_text())
    names = {"jaxsat native, Dopri8 adaptive", "lax.scan by hand, RK4"}
    assert found["accuracy"].keys() == names
    assert found["accuracy"]["jaxsat native, Dopri8 adaptive"]["error"] <= 1e-6
    assert {count: row.keys() for count, row in found["rows"].items()} == {"1": names, "3": names}
    assert sum(line.startswith("| ") for line in told) == 5

    options = ["--judged", warm, "--only", "lax.scan", "--cold-cases", 2]
    lines_here("engines", "--cases", "--duration", 2, *options, "--json", cold)
    (entry,) = json.loads(cold.read_text())["cold"].values()
    assert entry["peak_MB"] > entry["own_MB"] > 0
    assert entry["cold"] > 0


@pytest.mark.slow
def test_a_campaign_of_kills_finds_no_fault(tmp_path):
    """A study is killed, resumed and equal to one never disturbed; all of it is counted."""
    options = ["--kills", 1, "--seed", 2, "--only", "montecarlo, native"]
    heading, _, row = lines_of("kill_campaign", *options, TMPDIR=str(tmp_path))[-3:]
    found = dict(zip(heading.split(" | "), row.split(" | "), strict=True))
    assert int(found["kills"]) >= 1
    assert int(found["equal"]) >= 1
    assert found["faults |"] == "0 |"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_false_alarms_are_counted_of_wheels_too():
    """Three wheels of four are in use, with three tests each; nothing fails."""
    options = ["--scenario", "failures-telescope", "--set", "simulation.duration_s=20"]
    told = lines_of("false_alarms", "--cases", 2, *options)
    assert "2 of 2 cases, 0 false alarms" in told
    assert "9 tests, 3 of each actuator that is in use" in told
    level, _, expected = told[-1].split()
    scores = 9 * 56770 / float(expected)
    assert scores == pytest.approx(average_run_length(1.0, float(level)), rel=0.01)


@pytest.mark.slow
def test_a_torque_from_outside_is_counted_as_no_failure(lines_here):
    """Four cases in which nothing fails and eight with a failure, at 1 % of a thruster's torque."""
    told = lines_here("model_errors", "--cases", 4, "--torque", 0.01)
    settled, _, alarmed, mistaken, *failed = told[-1].split()[2:]
    assert (settled, mistaken, failed) == ("4", "0", ["8", "0"])
    assert int(alarmed) <= 1  # by a torque, which the alarm finds


def test_a_family_of_mixes_has_the_devices_that_its_table_tells():
    """One that keeps a wheel and magnetorquers, for five orbits, and one with thrusters."""
    from family_of_mixes import member

    for number, devices, slow in ((44, [3, 0, 2], True), (6, [2, 8, 0], False)):
        row, scenario = member(number)
        assert (scenario.simulation.duration_s == 28800) == slow
        tables = (scenario.wheel, scenario.thruster, scenario.magnetorquer)
        assert [len(one) for one in tables] == devices
        assert [row[one] for one in ("wheels", "thrusters", "magnetorquers")] == devices
        assert len(scenario.failure) == str(row["failures"]).count(" at ")
        assert scenario.orbit.altitude_km == pytest.approx(row["altitude_km"], abs=0.5)


@pytest.mark.slow
def test_tubes_are_compared_with_flights(lines_here, monkeypatch):
    import enclosures

    monkeypatch.delitem(enclosures.LOOPS, "slew")
    _, row, verdict, *others = lines_here("enclosures")
    assert row.startswith("| contest | True | 1.0")
    assert verdict == "proved"
    assert others[0].startswith("| rate | True | 1.0")
    assert others[1].startswith("| three-axis | True | 1.2")
