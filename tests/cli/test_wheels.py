"""Commands that know no wheels say so; a run tells what they took."""

import pytest


def test_a_bound_refuses_wheels(command_line):
    status, _, error = command_line("bound", "two-wheel-telescope")
    assert status == 2
    assert "wheel: must be left out" in error
    assert error.count("\n") == 1


@pytest.mark.slow
def test_a_run_tells_the_momentum_of_its_wheels(command_line):
    status, out, _ = command_line(
        "simulate", "two-wheel-telescope", "--set", "simulation.duration_s=20"
    )
    assert status == 0
    assert "N m s by all actuators; wheels up to (" in out
