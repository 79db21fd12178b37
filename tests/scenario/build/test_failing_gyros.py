"""Flights on which a gyro fails: by the dynamics they go on as `docs/sensors.md` says."""

import re
from pathlib import Path

import numpy as np
import pytest

from jaxsat.scenario import dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.store.dataset import time_to_settle, trajectory_dataset

PAGE = Path(__file__).parents[3] / "docs/sensors.md"
VEHICLES = {
    "wheels": ("wheels-fail", 400.0, 3.2e-6, ("1e-5", "1e-4")),
    "thrusters": ("thruster-dies", 450.0, 3.2e-5, ("1e-6", "1e-6")),
}
"""Scenario, time of the failure (s), deviation of a rate (rad/s), and torques that are unknown."""


def failures(at, deviation):
    begin = f'{{of="gyro", at_s={at}, kind='
    slow = deviation / 100
    return {
        "dead": f'{begin}"dead"}}',
        "stuck": f'{begin}"stuck"}}',
        "drifting": f'{begin}"drifting", drift_rad_s2=[{deviation}, 0, {-deviation}]}}',
        "drifting slowly": f'{begin}"drifting", drift_rad_s2=[{slow}, 0, {-slow}]}}',
        "spiking": f'{begin}"spiking", spike_rad_s=0.01, spike_probability=0.2}}',
    }


def flown(vehicle, failure):
    name, _, _, (noise, sigma) = VEHICLES[vehicle]
    scenario = load(
        name,
        [
            *("control.law=quaternion-feedback", f"failure=[{failure}]"),
            *("estimator.false_alarm_probability=1e-6", "estimator.rate_sigma_rad_s=0.002"),
            f"estimator.torque_noise_N_m_sqrt_Hz={noise}",
            f"estimator.torque_sigma_N_m={sigma}",
        ],
    )
    run = build(scenario).simulate()
    return trajectory_dataset(run, title=vehicle, scenario=dump(scenario), seed=0)


def told(vehicle, kind):
    """The row of the page: errors of attitude (deg) and rate (deg/s), and when it is excluded."""
    (row,) = re.findall(rf"^\| {vehicle} \| {kind} \|.*$", PAGE.read_text("utf-8"), re.MULTILINE)
    *_, attitude, rate, excluded = (cell.strip() for cell in row.strip("|").split("|"))
    return float(attitude), float(rate), excluded


@pytest.mark.slow
@pytest.mark.skipif(not PAGE.is_file(), reason="no docs beside the package")
@pytest.mark.parametrize("kind", ["dead", "stuck", "drifting", "drifting slowly", "spiking"])
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_a_gyro_that_fails_in_a_slew_is_survived(vehicle, kind):
    _, at, deviation, _ = VEHICLES[vehicle]
    dataset = flown(vehicle, failures(at, deviation)[kind])
    assert list(dataset["attitude_sensor"].values) == ["star_tracker", "gyro"]
    after = dataset["time"].values > at
    attitude, rate = (
        np.degrees(np.linalg.norm(dataset[f"{name}_estimate_error"].values[after], axis=1)).max()
        for name in ("attitude", "rate")
    )
    excluded = dataset["sensor_excluded"].values
    assert not excluded[:, 0].any()
    assert not excluded[~after, 1].any()
    assert np.isfinite(time_to_settle(dataset))
    of_attitude, of_rate, when = told(vehicle, kind)
    np.testing.assert_allclose([attitude, rate], [of_attitude, of_rate], rtol=0.1)
    found = "never"
    if excluded[:, 1].any():
        found = f"{dataset['time'].values[np.argmax(excluded[:, 1])] - at:g} s"
    assert found == when
