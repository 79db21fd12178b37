"""Commands that know no wheels say so; a run tells what they took."""

import re

import pytest


def test_a_bound_refuses_wheels(command_line):
    status, _, error = command_line("bound", "two-wheel-telescope")
    assert status == 2
    assert "wheel: must be left out" in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_two_wheels_are_judged_by_the_momentum_there_is(command_line):
    status, out, _ = command_line("controllability", "two-wheel-telescope")
    assert status == 0
    assert "rank 5 of 5" in out
    assert "n·Jω stays zero" in out
    changes = ["initial.omega_rad_s=[0.01, 0, 0.01]", "initial.quaternion=[1.0, 0, 0, 0]"]
    changes.append("spacecraft.inertia_kg_m2=[400.0, 400.0, 400.0]")
    sets = [part for change in changes for part in ("--set", change)]
    status, out, _ = command_line("controllability", "two-wheel-telescope", *sets)
    assert (status, "Some attitudes" in out) == (0, True)
    assert "nearest to the target 45° from it" in " ".join(out.split())


@pytest.mark.slow
def test_a_run_tells_the_momentum_of_its_wheels(command_line):
    status, out, _ = command_line(
        "simulate", "two-wheel-telescope", "--set", "simulation.duration_s=20"
    )
    assert status == 0
    assert "N m s by all actuators" in out
    assert re.search(r"^wheels +at most \(", out, re.MULTILINE)
