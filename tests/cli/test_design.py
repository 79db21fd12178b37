"""`jaxsat design`."""

import functools
import json

import pytest

ONE_TORQUE = ("two-torque-free", "--set", "spacecraft.failed_thrusters=[2,3]", "--law", "all")


@pytest.fixture
def jaxsat(command_line):
    return functools.partial(command_line, "design")


def test_nothing_to_design_is_a_plain_statement(jaxsat, tmp_path):
    status, out, err = jaxsat(*ONE_TORQUE, "--out", "d")
    assert status == 1
    assert "Nothing to design. No law of jaxsat fits the remaining actuators." in out
    assert "rank 2 of 6" in out
    assert "Traceback" not in err
    assert json.loads((tmp_path / "d" / "design.json").read_text())["chosen"] is None
    again, same, _ = jaxsat(*ONE_TORQUE, "--out", "d")
    assert (again, same) == (status, out)
    assert jaxsat(*ONE_TORQUE, "--out", "d", "--quiet")[1] == ""


def test_a_bare_vehicle_without_its_torque_limit_is_told_what_lacks(jaxsat, tmp_path):
    (tmp_path / "bare.toml").write_text(
        "[spacecraft]\ninertia_kg_m2 = [3, 2, 2.5]\nthruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\n"
    )
    status, out, _ = jaxsat("bare.toml")
    assert status == 1
    assert "torque_limit_N_m" in out
    assert "written to jaxsat-bare-designed" in out


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["no-such"], "no-such: no such file, and no scenario of jaxsat"),
        (
            ["two-torque-free", "--law", "rate"],
            "--law: must be one that aims at an attitude: a law",
        ),
        (["two-torque-free", "--law", "rats"], "--law: must be a law (three-slew, oscillatory, "),
        (["paper-rate"], "--law: must be given, as rate, the scenario's own, aims at no attitude"),
        (["one-torque-damping"], "--law: must be given, as one-torque, the scenario's own, aims"),
        (["two-torque-free", "--seed", f"{2**63}"], f"--seed: must be from 0 to {2**63 - 4}, got "),
        (["two-torque-free", "--cases", "0"], "--cases: must be a whole number"),
        (["two-torque-free", "--settled", "2"], "--settled: must be a number"),
        (["two-torque-free", "--attitude", "up"], "attitude"),
        (["two-torque-free", "--set", "spacecraft.mass=3"], "mass"),
    ],
)
def test_mistakes(jaxsat, tmp_path, given, told):
    status, _, err = jaxsat(*given, "--out", "d")
    assert status == 2
    assert told in err
    assert not (tmp_path / "d").exists()


def test_a_folder_of_something_else_is_left_alone(jaxsat, tmp_path):
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "mine.txt").write_text("mine")
    status, _, err = jaxsat(*ONE_TORQUE, "--out", "d")
    assert status == 2
    assert "holds what jaxsat did not write" in err
    assert [path.name for path in (tmp_path / "d").iterdir()] == ["mine.txt"]
