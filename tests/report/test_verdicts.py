"""Alarms and verdicts of a law that diagnoses its thrusters, as figures tell them."""

import numpy as np
import xarray as xr

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.report.timeline import DIAGNOSED, diagnoses, exclusions, failure_sentences, verdicts


def test_alarms_and_verdicts_are_found_in_the_signals():
    kinds = np.full((8, 3), -1.0)
    kinds[3:6, 1] = DiagnosedKind.STUCK_ON
    mode = xr.Variable("time", [0.0, 0, 1, 2, 2, 1, 0, 0])
    mode.attrs |= {"flag_values": [0.0, 1, 2], "flag_meanings": "three_axes alarm reallocated"}
    kinds = xr.Variable(("time", "thruster"), kinds)
    found = xr.Dataset(
        {"mode": mode, "diagnosed_kind": kinds},
        {"time": np.arange(8) * 10.0, "thruster": [1, 2, 3]},
    )
    assert verdicts(found) == [
        (20.0, "alarm"),
        (30.0, "thruster 2: isolated as stuck on"),
        (50.0, "alarm"),
        (60.0, "thruster 2: works again"),
    ]
    assert verdicts(found.drop_vars("diagnosed_kind")) == []
    named = found.assign_coords(thruster=["a+", "a-", "b"])
    assert verdicts(named)[1] == (30.0, "thruster a-: isolated as stuck on")


def test_verdicts_on_magnetorquers_tell_what_part_of_its_dipole_each_makes():
    part = np.ones((6, 2))
    part[2:5, 1], part[3, 1], part[4:, 0] = 0.4, 0.42, 0.0
    part[5, 1] = 1.0
    found = xr.Dataset(
        {"diagnosed_dipole": xr.Variable(("time", "magnetorquer"), part)},
        {"time": np.arange(6) * 10.0, "magnetorquer": ["x", "y"]},
    )
    assert verdicts(found) == [
        (20.0, "magnetorquer y: isolated, makes 40%"),
        (40.0, "magnetorquer x: isolated, makes 0%"),
        (50.0, "magnetorquer y: works again"),
    ]


def test_a_sentence_on_each_failure_says_whether_the_law_isolated_it():
    """The last verdict on a magnetorquer counts, and one on a device that works is told as such."""
    kinds, parts = np.full((6, 3), -1.0), np.ones((6, 2))
    kinds[2:, 0], kinds[4:, 2] = DiagnosedKind.DEAD, DiagnosedKind.DEGRADED
    parts[3, 0], parts[4:, 0] = 0.33, 0.0
    found = xr.Dataset(
        {
            "mode": xr.Variable("time", np.zeros(6)),
            "diagnosed_kind": xr.Variable(("time", "actuator"), kinds),
            "diagnosed_dipole": xr.Variable(("time", "magnetorquer"), parts),
        },
        {"time": np.arange(6) * 10.0, "actuator": ["thruster a+", "wheel B", "wheel C"]}
        | {"magnetorquer": ["x", "y"]},
    )
    tables = [
        {"of": "magnetorquer x", "at_s": 15.0, "kind": "stuck-at", "fraction": 0.2},
        {"of": "thruster a", "at_s": 10.0, "kind": "dead"},
        {"of": "wheel B", "at_s": 5.0, "kind": "friction-up", "friction_N_m": 0.4},
        {"of": "gyro", "at_s": 12.0, "kind": "turned", "turn_rad": [0.0, 0.1, 0.0]},
        {"of": "thruster a", "at_s": 45.0, "kind": "degraded", "fraction": 1.0},
        {"of": "wheel C", "at_s": 60.0, "kind": "dead"},
    ]
    assert list(failure_sentences(found, {"failure": tables})) == [
        (5.0, "Wheel B friction up (friction 0.4 N m) at 5 s; not isolated."),
        (10.0, "Thruster a dead at 10 s; isolated as dead at 20 s."),
        (12.0, "Gyro turned (turn (0, 0.1, 0) rad) at 12 s."),
        (15.0, "Magnetorquer x stuck at (fraction 0.2) at 15 s; isolated, makes 0% at 30 s."),
        (45.0, "Thruster a degraded (fraction 1) at 45 s; still isolated as dead."),
        (40.0, "Wheel C isolated as degraded at 40 s, although it had not failed."),
    ]
    before = {"wheel": [{"name": "C", "failed": True}]}
    assert list(failure_sentences(found, before))[-1] == (
        40.0,
        "Wheel C isolated as degraded at 40 s.",
    )
    names = ["thruster a+", "wheel B", "wheel C", "magnetorquer x", "magnetorquer y"]
    assert list(diagnoses(found)) == names
    assert [diagnoses(found)[name] for name in names[1:3]] == ["", "isolated as degraded at 40 s"]


def test_every_kind_has_its_words():
    assert len(DIAGNOSED) == len(DiagnosedKind)
    for kind in DiagnosedKind:
        assert DIAGNOSED[kind].startswith(kind.name.lower().replace("_", " "))


def test_sensors_are_excluded_and_used_again_but_not_after_an_early_end():
    states = np.array([[0, 0], [1, 0], [0, 0], [1, 1], [np.nan, np.nan]])
    dataset = xr.Dataset(
        {"sensor_excluded": (("time", "attitude_sensor"), states)},
        {"time": np.arange(5.0), "attitude_sensor": ["star_tracker", "sun_sensor"]},
    )
    assert exclusions(dataset) == [
        (1.0, "star tracker excluded"),
        (2.0, "star tracker used again"),
        (3.0, "star tracker excluded"),
        (3.0, "sun sensor excluded"),
    ]
