"""Alarms and verdicts of a law that diagnoses its thrusters, as figures tell them."""

import numpy as np
import xarray as xr

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.report.timeline import DIAGNOSED, exclusions, verdicts


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
        (30.0, "thruster 2: isolated, stuck on"),
        (50.0, "alarm"),
        (60.0, "thruster 2: works again"),
    ]
    assert verdicts(found.drop_vars("diagnosed_kind")) == []
    named = found.assign_coords(thruster=["a+", "a-", "b"])
    assert verdicts(named)[1] == (30.0, "thruster a-: isolated, stuck on")


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
