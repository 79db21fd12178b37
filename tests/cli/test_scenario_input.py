"""Scenarios as input of the commands: one message each, status 2, never a traceback."""

import os

import pytest

J1_IS_J2 = ["--set", "spacecraft.inertia_kg_m2=[300,300,312.5]"]


@pytest.mark.parametrize(
    "command", [["simulate"], ["montecarlo", "-n", "4"], ["scenarios", "check"]]
)
@pytest.mark.parametrize(
    ("changes", "key"),
    [
        (J1_IS_J2, "spacecraft.inertia_kg_m2"),
        (["--set", "orbit.altitude_km=1e300"], "orbit.altitude_km"),
        (["--set", "sampling.delay_s=0.01", "--set",
          "dispersion.delay_s={distribution='uniform',low=-0.05,high=0.3}"],
         "dispersion.delay_s.low"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_refused(command_line, tmp_path, command, changes, key):
    status, out, err = command_line(*command, "acceptance-mc", *changes)
    assert (status, out) == (2, "")
    lines = [line for line in err.splitlines() if not line.startswith("warning: ")]
    assert all(f"key {key.removesuffix('low')}" in line for line in lines)
    assert not list(tmp_path.iterdir())


def test_controllability_needs_no_law(command_line):
    status, out, err = command_line("controllability", "two-torque-free", *J1_IS_J2)
    assert (status, err) == (0, "")
    assert "J1" in out or out


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["--longest", "1e-9"], "--longest: must be a number from 0.01 to 1e+09, got 1e-9"),
        (["--longest", "nan"], "--longest: must be a number from 0.01"),
        (["--set", "simulation.duration_s=1e-3", "--set", "simulation.save_every_s=1e-3"],
         "simulation.duration_s: must be at least 0.00948 s"),
        (["--out", "there.json"], "there.json already exists; give --overwrite"),
        (["--out", "."], "is not a file"),
        (["--out", "no/such/place.json"], "is not a folder"),
    ],
)  # fmt: skip
def test_mistakes_of_bound(command_line, tmp_path, tokens, message):
    (tmp_path / "there.json").write_text("mine")
    status, out, err = command_line("bound", "two-torque-free", *tokens)
    assert (status, out) == (2, "")
    assert message in err
    assert (tmp_path / "there.json").read_text() == "mine"


def test_names_and_titles_cannot_speak_to_the_terminal(command_line, tmp_path):
    name = "a\x1b[31mb.toml"
    (tmp_path / name).write_text("title = 'x'\n")
    status, _, err = command_line("scenarios", "check", name, os.fsdecode(b"\xff.toml"))
    assert status == 2
    assert "\x1b" not in err
    assert "a\\x1b[31mb.toml:1: key spacecraft: must be given" in err
    assert "must be a name of valid characters" in err
