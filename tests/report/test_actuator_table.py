"""What each actuator did: in rows and in one sentence."""

import numpy as np

from helpers.pages import run_dataset
from jaxsat.report.actuator_table import actuator_tables, share_sentence
from jaxsat.report.facts import scenario_tables
from jaxsat.report.timeline import failures_of


def rows_of(run):
    scenario = scenario_tables(run)
    failures = failures_of(scenario, run["time"].values)
    (table,) = actuator_tables(run, scenario, failures)
    return {row[0]: row[1:] for row in table.rows}


def test_a_row_says_what_each_device_did_and_how_it_failed():
    time = np.linspace(0.0, 10.0, 101)
    names = {"thruster": ["up", "2"], "wheel": ["1"]}
    run = run_dataset().assign_coords(names)
    seconds = [np.diff(time) @ abs(one(time))[:-1] for one in (np.sin, np.cos)]
    assert rows_of(run) == {
        "thruster up": [f"{seconds[0]:.3g} s at full thrust", "dead at 3.5 s"],
        "thruster 2": [f"{seconds[1]:.3g} s at full thrust", "failed before the start"],
        "wheel 1": ["0 to -1.09 N m s, at most 2, 50 % of its limit", ""],
    }
    run["wheel_momentum"] = (3 * run["wheel_momentum"]).clip(-4, 4).assign_attrs(units="N m s")
    first = time[np.flatnonzero(6 * np.sin(time) >= 4)[0]]
    assert rows_of(run)["wheel 1"] == [f"0 to -3.26 N m s, at most 4, full at {first:g} s", ""]


def test_both_ways_of_a_thruster_have_its_failure():
    run = run_dataset().assign_coords(thruster=["up+", "up-"], wheel=["1"])
    assert [rows_of(run)[f"thruster up{way}"][1] for way in "+-"] == ["dead at 3.5 s"] * 2


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
