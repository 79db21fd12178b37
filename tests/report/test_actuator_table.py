"""What each actuator did: in rows and in one sentence."""

import numpy as np
import pytest

from helpers.pages import run_dataset
from jaxsat.report.actuator_table import actuator_tables, saturation_sentences, share_sentence
from jaxsat.report.document import Shown
from jaxsat.report.facts import scenario_tables


def rows_of(run):
    """Cells by heading, of each actuator."""
    scenario = scenario_tables(run)
    (table,) = actuator_tables(run, scenario)
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    return {row.pop("actuator"): row for row in rows}


def test_a_row_says_what_each_device_did_and_how_it_failed():
    time = np.linspace(0.0, 10.0, 101)
    names = {"thruster": ["up", "2"], "wheel": ["1"]}
    run = run_dataset().assign_coords(names)
    run["valve_openings"] = (("time", "thruster"), np.outer(time, [2, 3]))
    seconds = [np.diff(time) @ abs(one(time))[:-1] for one in (np.sin, np.cos)]
    on = "at full thrust (s)"
    rows = rows_of(run)
    assert list(rows) == ["thruster up", "thruster 2", "wheel 1"]
    for name, value in zip(("thruster up", "thruster 2"), seconds, strict=True):
        assert rows[name][on].text == f"{value:.3g}"
        assert rows[name][on].value == pytest.approx(value, rel=1e-12)
        assert rows[name]["of its limit (%)"] is None
    assert [rows[name]["openings"] for name in rows] == [20, 30, None]
    fates = ["dead at 3.5 s", "failed before the start", ""]
    assert [rows[name]["failure"] for name in rows] == fates
    assert {
        name: cell.text for name, cell in rows["wheel 1"].items() if isinstance(cell, Shown)
    } == {
        "momentum at the start (N m s)": "0",
        "momentum at the end (N m s)": "-1.09",
        "momentum at most (N m s)": "2",
        "of its limit (%)": "50",
    }
    assert list(rows["wheel 1"])[-1] == "failure"
    kinds = np.full((101, 1), -1.0)
    kinds[40:] = 0
    run["diagnosed_kind"] = (("time", "wheel"), kinds)
    assert [list(row.items())[-1] for row in rows_of(run).values()] == [
        ("diagnosis", text) for text in ("", "", "isolated as dead at 4 s")
    ]


def test_the_times_at_which_a_wheel_is_nearly_full_and_full_are_told():
    run = run_dataset().assign_coords(wheel=["1"])
    time = run["time"].values
    run["wheel_momentum"] = (3 * run["wheel_momentum"]).clip(-4, 4).assign_attrs(units="N m s")
    near, full = (time[np.flatnonzero(6 * np.sin(time) >= level)[0]] for level in (3.6, 4))
    row = rows_of(run)["wheel 1"]
    assert (row["90 % at (s)"].value, row["100 % at (s)"].value) == (near, full)
    (sentence,) = saturation_sentences(run, scenario_tables(run))
    assert sentence == f"Wheel 1 held 90 % of its limit from {near:g} s and was full at {full:g} s."


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_that_fills_is_told_before_it_is_full(sign):
    """0.02 N m fill 4 N m s from 0.5 N m s in 175 s; an oscillation of more is no trend."""
    run = run_dataset().assign_coords(wheel=["1"])
    time, scenario = run["time"].values, scenario_tables(run)

    def momentum(swing):
        values = sign * (0.5 + 0.02 * time + swing * np.sin(5 * time))
        return run.assign(wheel_momentum=(("time", "wheel"), values[:, None]))

    (sentence,) = saturation_sentences(momentum(0.0), scenario)
    assert sentence == "Wheel 1 will be full at 175 s by the trend of the second half."
    assert not list(saturation_sentences(momentum(0.05), scenario))
    assert not list(saturation_sentences(run, scenario))


def test_both_ways_of_a_thruster_have_its_failure():
    run = run_dataset().assign_coords(thruster=["up+", "up-"], wheel=["1"])
    assert [rows_of(run)[f"thruster up{way}"]["failure"] for way in "+-"] == ["dead at 3.5 s"] * 2


def test_shares_of_torque_over_time_are_told_where_several_kinds_make_it():
    """A wheel makes 0.3 N m about y all the time, thrusters 0.1 N m about z in half of it."""
    run = run_dataset()
    time = run["time"].values
    assert not list(share_sentence(run))
    pulses = 0.1 * (time < 5.0 - 1e-9)
    torque = np.stack([0 * time, 0.3 + 0 * time, pulses], 1)
    run["torque"] = (("time", "body_axis"), torque)
    run["wheel_torque"] = (("time", "wheel"), np.full((101, 1), 0.3))
    run["propellant"] = ("time", 0.02 * time)
    (sentence,) = share_sentence(run)
    by_wheels = 100 * 3.0 / (3.0 + 0.5)
    assert sentence == (
        f"Torque over the run: {by_wheels:.3g} % by wheels, {100 - by_wheels:.3g} % by thrusters, "
        "with 0.2 kg of propellant."
    )
    run["torque"] = (("time", "body_axis"), 0 * torque)
    run["wheel_torque"] = (("time", "wheel"), np.zeros((101, 1)))
    assert not list(share_sentence(run))
