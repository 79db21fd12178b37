"""Gyros and star trackers that differ from case to case, while the filter believes the same."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.navigation.navigation import Delivery
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.navigation_sensors import StarTracker
from jaxsat.studies.distributions import Uniform
from jaxsat.studies.quantities import QUANTITIES
from studies.copies import copies_of

SENSORS = [
    "gyro={noise_density_rad_s_sqrt_Hz=1e-5, bias_walk_rad_s2_sqrt_Hz=1e-8, outage_start_s=5,"
    "outage_s=1, outage_every_s=3}",
    "star_tracker={across_rad=1e-5, along_rad=1e-4, latency_s=0.3, outage_start_s=4, outage_s=2,"
    "outage_every_s=5}",
    "magnetometer={noise_T=1e-6, update_period_s=0.2, outage_start_s=3, outage_s=1,"
    "outage_every_s=3}",
    "sun_sensor={noise_rad=1e-3, latency_s=0.1, outage_start_s=2, outage_s=1, outage_every_s=3}",
    "horizon_sensor={noise_rad=1e-3, outage_start_s=2, outage_s=1, outage_every_s=3}",
]
PERIOD = 0.1
REACHES = {
    "gyro_noise_density": lambda one: one.gyro.noise_density[:, None],
    "gyro_bias_walk": lambda one: one.gyro.bias_walk[:, None],
    "gyro_bias": lambda one: one.gyro.bias,
    "gyro_scale_factor": lambda one: one.gyro.scale_factor,
    "gyro_misalignment": lambda one: one.gyro.misalignment,
    "gyro_outage_start": lambda one: one.gyro.outage_start[:, None],
    "gyro_outage": lambda one: one.gyro.outage[:, None],
    "gyro_outage_every": lambda one: one.gyro.outage_every[:, None],
    "tracker_across": lambda one: one.tracker.across[:, None],
    "tracker_along": lambda one: one.tracker.along[:, None],
    "tracker_update_period": lambda one: one.tracker.every[:, None] * PERIOD,
    "tracker_latency": lambda one: one.tracker.arrival[:, None] * PERIOD,
    "tracker_rate_limit": lambda one: one.tracker.rate_limit[:, None],
    "tracker_outage_start": lambda one: one.tracker.outage_start[:, None],
    "tracker_outage": lambda one: one.tracker.outage[:, None],
    "tracker_outage_every": lambda one: one.tracker.outage_every[:, None],
    "magnetometer_noise": lambda one: one.sensors["magnetometer"].noise[:, None],
    "magnetometer_bias": lambda one: one.sensors["magnetometer"].bias,
    "magnetometer_scale_factor": lambda one: one.sensors["magnetometer"].scale_factor,
    "magnetometer_misalignment": lambda one: one.sensors["magnetometer"].misalignment,
    "magnetometer_outage_start": lambda one: one.sensors["magnetometer"].outage_start[:, None],
    "magnetometer_outage": lambda one: one.sensors["magnetometer"].outage[:, None],
    "magnetometer_outage_every": lambda one: one.sensors["magnetometer"].outage_every[:, None],
    "sun_sensor_noise": lambda one: one.sensors["sun_sensor"].noise[:, None],
    "sun_sensor_misalignment": lambda one: one.sensors["sun_sensor"].misalignment,
    "sun_sensor_outage_start": lambda one: one.sensors["sun_sensor"].outage_start[:, None],
    "sun_sensor_outage": lambda one: one.sensors["sun_sensor"].outage[:, None],
    "sun_sensor_outage_every": lambda one: one.sensors["sun_sensor"].outage_every[:, None],
    "horizon_sensor_noise": lambda one: one.sensors["horizon_sensor"].noise[:, None],
    "horizon_sensor_misalignment": lambda one: one.sensors["horizon_sensor"].misalignment,
    "horizon_sensor_outage_start": lambda one: one.sensors["horizon_sensor"].outage_start[:, None],
    "horizon_sensor_outage": lambda one: one.sensors["horizon_sensor"].outage[:, None],
    "horizon_sensor_outage_every": lambda one: one.sensors["horizon_sensor"].outage_every[:, None],
}


def loop() -> Any:
    return build(load("switching", ["simulation.duration_s=12", *SENSORS])).loop


def test_every_quantity_of_sensors_has_its_test():
    parts = ("gyro", "tracker", "magnetometer", "sun_sensor", "horizon_sensor")
    assert set(REACHES) == {name for name in QUANTITIES if name.startswith(parts)}


def test_they_reach_the_sensors_and_not_what_the_filter_believes():
    nominal = loop()
    drawn: Any = dict.fromkeys(REACHES, Uniform(0.1, 0.3))
    drawn |= dict.fromkeys(("magnetometer_noise", "magnetometer_bias"), Uniform(1e-4, 3e-4))
    copy = copies_of(nominal, 5, **drawn)
    found = jax.tree.map(np.asarray, copy.loop.navigation)
    for name, read in REACHES.items():
        numbers = np.asarray(copy.drawn[name])
        if name in ("tracker_update_period", "tracker_latency"):
            numbers = np.round(numbers / PERIOD) * PERIOD
        np.testing.assert_allclose(read(found), numbers, rtol=1e-12, err_msg=name)
        assert np.ptp(numbers) > 0
    believed = jax.tree.map(lambda x: x[0], eqx.filter(found.estimator, eqx.is_array))
    own = eqx.filter(nominal.navigation.estimator, eqx.is_array)
    for one, other in zip(jax.tree.leaves(believed), jax.tree.leaves(own), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_measurement_arrives_when_the_latency_of_the_case_is_over():
    tracker = StarTracker(1e-5, 1e-5, latency=3)
    queue: Any = Delivery(jnp.arange(16.0).reshape(4, 4), jnp.array([True, False, True, False]))
    assert tracker.arriving(queue).attitude[0] == 0.0  # three samples ago
    sooner = eqx.tree_at(
        lambda one: one.arrival, tracker, jnp.array(1), is_leaf=lambda x: x is None
    )
    assert sooner.arriving(queue).attitude[0] == 8.0
    assert sooner.arriving(queue).seen


@pytest.mark.parametrize("periods", [3, 6, 7])
def test_the_declared_latency_may_be_drawn_whatever_its_rounding(periods):
    latency = round(0.7 * periods, 1)
    sensors = f"star_tracker={{across_rad=1e-5, along_rad=1e-4, latency_s={latency}}}"
    table = f"{{distribution='uniform', low=0, high={latency}}}"
    changes = ["control.period_s=0.7", "simulation.duration_s=7", "simulation.save_every_s=0.7"]
    changes += [SENSORS[0], sensors, f"dispersion.tracker_latency_s={table}"]
    load("switching", changes, purpose="study")


def test_an_outage_is_from_its_start_to_its_end():
    tracker = StarTracker(1e-5, 1e-5, every=2, outage_start=1.0, outage=0.5)
    still, period = jnp.zeros(3), jnp.array(0.125)
    seen = [number for number in range(20) if tracker.measures(jnp.array(number), period, still)]
    assert seen == [0, 2, 4, 6, 12, 14, 16, 18]
    alone: Any
    for alone in ({"outage_start": 1.0}, {"outage": 1.0}):
        with pytest.raises(ValueError, match="must be given together"):
            StarTracker(1e-5, 1e-5, **alone)


@pytest.mark.slow
def test_engines_agree_on_dispersed_sensors():
    ranges = {"gyro_bias_rad_s": (-1e-3, 1e-3), "tracker_update_period_s": (0.1, 1.0),
              "tracker_latency_s": (0.0, 0.3), "tracker_outage_start_s": (1.0, 5.0),
              "gyro_outage_start_s": (0.5, 4.0), "gyro_outage_every_s": (1.5, 3.0),
              "magnetometer_bias_T": (-1e-6, 1e-6),
              "sun_sensor_noise_rad": (1e-4, 1e-2), "sun_sensor_outage_s": (0.1, 1.0)}  # fmt: skip
    tables = [
        f"dispersion.{key}={{distribution='uniform', low={low}, high={high}}}"
        for key, (low, high) in ranges.items()
    ]
    changes = ["simulation.duration_s=8", *SENSORS, *tables]
    scenario = load("switching", changes, purpose="study")
    found = {
        engine: build_study(scenario, 5, engine=engine, batch_size=6).evaluate(np.arange(5))
        for engine in ("native", "diffrax")
    }
    np.testing.assert_allclose(found["native"].omega, found["diffrax"].omega, atol=1e-9)
    assert np.ptp(found["native"].omega, axis=0).max() > 1e-4
