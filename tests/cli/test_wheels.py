"""Commands that know no wheels say so; a run tells what they took."""

import pytest


@pytest.mark.parametrize("command", ["controllability", "bound"])
def test_commands_that_judge_thrusters_refuse_wheels(command_line, command):
    status, _, error = command_line(command, "two-wheel-telescope")
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
