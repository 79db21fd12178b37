"""Outages of sensors that come again and again, against a list of intervals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.sensors import Tachometers

PERIOD = 0.125
TIMES = PERIOD * np.arange(65)
OUTAGES = {"outage_start": 1.25, "outage": 0.5, "outage_every": 2.0}
INTERVALS = [(1.25, 1.75), (3.25, 3.75), (5.25, 5.75), (7.25, 7.75)]
"""Begins and ends until 8 s, s."""


def outside(intervals):
    """Whether each sample is outside all intervals, of which the end is excluded."""
    return [not any(begin <= t < end for begin, end in intervals) for t in TIMES]


def valid(sensor):
    """Whether a sensor says that each sample is valid."""
    still = [jnp.zeros(3)] if isinstance(sensor, StarTracker) else []
    says = sensor.measures if still else sensor.is_valid
    return [bool(says(jnp.array(k), jnp.array(PERIOD), *still)) for k in range(len(TIMES))]


@pytest.mark.parametrize("sensor", [Gyro, lambda **times: StarTracker(1e-5, 1e-5, **times)])
def test_outages_of_a_sensor_come_again(sensor):
    assert valid(sensor(**OUTAGES)) == outside(INTERVALS)
    assert valid(sensor(**{**OUTAGES, "outage_every": None})) == outside(INTERVALS[:1])


@pytest.mark.parametrize(("start", "length", "every"), [(3, 2, 6), (1, 1, 3), (7, 5, 20)])
def test_outages_at_decimal_times_lose_no_sample(start, length, every):
    """Their begins and ends are at samples, 0.1 s apart, which integers tell."""
    sensor = Gyro(outage_start=start / 10, outage=length / 10, outage_every=every / 10)
    samples = np.arange(400)
    says = jax.vmap(lambda k: sensor.is_valid(k, jnp.array(0.1)))(jnp.asarray(samples))
    outside_all = (samples < start) | ((samples - start) % every >= length)
    np.testing.assert_array_equal(says, outside_all)


def test_outages_of_tachometers_come_again_each_in_its_time():
    """The last one has a single outage."""
    times = {
        "outage_start": [1.25, 2.0, 4.5],
        "outage": [0.5, 0.25, 1.0],
        "outage_every": [2.0, 3.0, np.inf],
    }
    others = [(2.0, 2.25), (5.0, 5.25), (8.0, 8.25), (4.5, 5.5)]
    assert valid(Tachometers(np.zeros(3), **times)) == outside([*INTERVALS, *others])


@pytest.mark.parametrize("every", [0.5, 0.25, 0.0, -2.0])
def test_there_is_time_between_outages(every):
    for sensor in (Gyro, lambda **times: StarTracker(1e-5, 1e-5, **times)):
        with pytest.raises(ValueError, match=r"outage_every.*above `outage`"):
            sensor(**{**OUTAGES, "outage_every": every})
    with pytest.raises(ValueError, match="outage_every"):
        Tachometers(np.zeros(2), outage_start=[1.0, 2.0], outage=[0.5, 0.5],
                    outage_every=[every, 3.0])  # fmt: skip


def test_what_comes_again_must_come_once():
    with pytest.raises(ValueError, match="`outage_every` must be given with `outage`"):
        Gyro(outage_every=2.0)
