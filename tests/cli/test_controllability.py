"""`jaxsat controllability` and `jaxsat reproduce` as a user meets them."""

import csv
import re

import numpy as np
import pytest
import xarray as xr

from helpers.gyros import document
from helpers.magnetic import scenario
from jaxsat.cli import main
from jaxsat.controllability.cone import direction_words
from jaxsat.scenario import Scenario, dump


def run(capsys, *tokens):
    with pytest.raises(SystemExit) as ended:
        main(tokens)
    out, err = capsys.readouterr()
    return ended.value.code, out, err


@pytest.mark.slow
def test_controllability_writes_tables_maps_and_a_page(capsys, tmp_path):
    folder = tmp_path / "out"
    status, out, _ = run(
        capsys, "controllability", "paper-three-axis", "--out", str(folder), "--drift"
    )
    assert status == 0
    assert "rank 6 of 6" in out
    assert "Recurrence" in out
    with (folder / "failures.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["rank"]) for row in rows] == [6, 6, 6, 6, 2, 2, 2, 0]
    with xr.open_dataset(folder / "failures.nc", engine="h5netcdf") as dataset:
        assert dataset.attrs["rank"] == 6
        np.testing.assert_array_equal(dataset["failed"].sum("actuator"), [0, 1, 1, 1, 2, 2, 2, 3])
    names = {file.name for file in folder.iterdir()}
    assert {"controllability.md", "inertia-map.png", "angle-map.svg", "energy.png"} <= names


@pytest.mark.slow
def test_controllability_tells_what_magnetorquers_add(capsys, tmp_path):
    file = tmp_path / "rods.toml"
    file.write_text(dump(scenario(2)))
    command = ["controllability", str(file)]
    status, out, _ = run(capsys, *command, "--set", "spacecraft.inertia_kg_m2=[0.05, 0.04, 0.03]")
    assert status == 0
    text = " ".join(out.split())
    assert "Magnetorquers and wheels control all axes over an orbit" in text
    assert "rank 8 of 8" in text
    assert "Without magnetorquers: some attitudes" in text
    assert "unload wheel momentum" in text
    assert "Magnetorquers alone remove one degree" in text
    assert "at the start; magnetorquers take momentum" in text
    status, out, _ = run(capsys, *command)
    assert "the body rests 11.5° from the orbit frame" in " ".join(out.split())


def test_control_moment_gyros_have_a_verdict_of_their_own(capsys, tmp_path):
    file = tmp_path / "gyros.toml"
    file.write_text(dump(Scenario.model_validate(document())))
    status, out, _ = run(capsys, "controllability", str(file))
    assert status == 0
    text = " ".join(out.split())
    assert "Controllable: 4 of 4 gimbals make three torques while they are not singular" in text
    assert "at least 0.46" in text
    assert "With one gimbal locked: 4 of 4 cases leave three torques" in text
    assert not re.search("uncontrollable|all control|no law|rank", text)


def test_locked_gyros_do_not_head_the_verdict_on_thrusters(capsys, tmp_path):
    file, data = tmp_path / "locked.toml", document()
    data["gimbal"] = [one | {"failed": True} for one in data["gimbal"]]
    jet = {"torque_N_m": 0.1, "two_sided": True}
    data["thruster"] = [{"torque_axis": axis, **jet} for axis in np.eye(3).tolist()]
    file.write_text(dump(Scenario.model_validate(data)))
    status, out, _ = run(capsys, "controllability", str(file))
    assert status == 0
    text = " ".join(out.split())
    assert "All gimbals are locked. Without the momentum of their rotors: controllable" in text
    assert "(Not controllable" not in text


def test_the_verdict_on_a_wheel_and_magnetorquers_begins_with_what_they_can_do(capsys):
    status, out, _ = run(capsys, "controllability", "wheel-and-rods")
    assert status == 0
    verdict = " ".join(out.split()).split(" - ")[0]
    first = verdict.index("Magnetorquers and wheels control all axes over an orbit")
    assert first < verdict.index("Without magnetorquers: not controllable")
    text = " ".join(out.split())
    assert "Survives 3 of 4 single" in text
    assert "Laws: the laws magnetic and fault-tolerant apply" in text


@pytest.mark.slow
def test_controllability_says_no_and_maybe(capsys):
    command = ["controllability", "paper-three-axis", "--set"]
    status, out, _ = run(capsys, *command, "spacecraft.inertia_kg_m2=[300, 300, 200]")
    assert status == 0
    assert "ot controllable" in out
    status, out, _ = run(
        capsys, *command, "spacecraft.inertia_kg_m2=[300, 300.000003, 200]", "--tolerance", "1e-5"
    )
    assert "orderline" in out


@pytest.mark.parametrize(
    "tokens",
    [
        ["controllability", "paper-three-axes"],
        ["controllability", "paper-rate", "--tolerance", "2"],
        ["controllability"],
        ["reproduce", "--outt", "x"],
    ],
)
def test_mistakes_exit_2(capsys, tokens):
    status, _, err = run(capsys, *tokens)
    assert status == 2
    assert "Traceback" not in err


def test_reproduce_refuses_before_it_computes(capsys, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    status, _, err = run(capsys, "reproduce", "--out", str(tmp_path))
    assert status == 2
    assert str(tmp_path) in err


@pytest.mark.slow
def test_thrusters_that_push_are_told_apart_from_torques_of_both_signs(capsys, tmp_path):
    with pytest.raises(SystemExit):
        main(("scenarios", "show", "paper-three-axis"))
    text = capsys.readouterr().out
    given = ("thruster_torque_axes", "failed_thrusters", "third_rate")
    lines = [line for line in text.splitlines() if not line.startswith(given)]
    for axis in ("[1, 0, 1]", "[-1, 0, 1]", "[0, 1, 1]", "[0, -1, 1]"):
        lines += ["[[thruster]]", f"torque_axis = {axis}", "torque_N_m = 1.0"]
    scenario = tmp_path / "pushing.toml"
    scenario.write_text("\n".join(lines))
    folder = tmp_path / "out"
    status, out, _ = run(capsys, "controllability", str(scenario), "--out", str(folder))
    assert status == 0
    assert "Controllable by drift" in out
    assert "No law of jaxsat uses it" in out
    assert "Survives: 0 of 4 single, 0 of 6 double, 0 of 4 triple failures." in out
    with (folder / "failures.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 16
    assert rows[0]["lost"].startswith("torque along -z")
    with xr.open_dataset(folder / "failures.nc", engine="h5netcdf") as dataset:
        assert dataset["laws"].values.tolist() == ["none"] * 16
        assert dataset["verdict"].values[0] == "by drift"
    names = {file.name for file in folder.iterdir()}
    assert {"torque-map.png", "failures.svg"} <= names
    assert "angle-map.png" not in names
    assert "none towards -z" in (folder / "controllability.md").read_text()


def test_what_survives_is_told_first_and_a_number_of_failures_is_listed(capsys):
    """Four skew wheels: any one or two may fail; numbers that do not exist are not printed."""
    status, out, _ = run(capsys, "controllability", "wheels-fail", "--failures", "2")
    lines = out.splitlines()
    assert status == 0
    told = "Survives 4 of 4 single, 6 of 6 double, 0 of 4 triple failures. (Controllable: rank"
    assert lines[1].startswith(told)
    assert sum("5 of 5" in line for line in lines) == 6
    assert "nan" not in out
    assert "-0.000" not in out
    assert "controllable" in out
    assert "…" not in out


def test_a_direction_near_an_axis_has_no_negative_zero():
    direction = np.array([-1e-5, 0.6, 0.8])
    assert direction_words(direction) == "(0.000, 0.600, 0.800)"


def test_more_digits_are_printed_where_they_are_asked_for(command_line):
    found = {}
    for digits in ((), ("--digits", "12")):
        status, out, _ = command_line("controllability", "wheels-fail", *digits)
        assert status == 0
        found[digits] = [len(one) for one in re.findall(r"\d of \d +0\.0*([1-9]\d*)", out)]
    assert set(found[()]) == {3}
    assert max(found[("--digits", "12")]) >= 10
