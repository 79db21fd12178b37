"""What failed sensors read, sample by sample, against SciPy's rotations and NumPy."""

from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.core.declaration.sensor import (
    GyroFailureKind,
    SensorFailureKind,
    TachometerFailureKind,
)
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.navigation_sensors import Gyro
from jaxsat.spacecraft.sensor_failures import (
    GyroFailures,
    SensorFailures,
    SensorReading,
    TachometerFailures,
)
from jaxsat.spacecraft.sensors import Tachometers
from jaxsat.spacecraft.wheels import WheelMomenta

PERIOD, RATE = 0.5, 1e-3
KEY = jnp.array([3, 4], jnp.uint32)


def failures(*each):
    """Failures of sensors, each (number, at, kind, amount, drift, quantile)."""
    columns = zip(*each, strict=True)
    return SensorFailures(*columns, orbit=ExactOrbit(RATE))


def vectors(events, readings, seen, sensor=0, count=2):
    """What is read of vectors, and whether, with the failures of one of `count` sensors."""
    read = _vectors(events, jnp.array(readings), jnp.array(seen), sensor, count)
    return list(zip(np.asarray(read.value), np.asarray(read.seen), strict=True))


@eqx.filter_jit
def _vectors(events, readings, seen, sensor, count):
    def sample(last, now):
        number, value, there = now
        condition = events.conditions(number, jnp.array(PERIOD), KEY, count)[sensor]
        read, last = events.vector(condition, SensorReading(value, there), last, jnp.array(True))
        return last, read

    first = SensorReading(jnp.zeros(3), jnp.array(False))
    return jax.lax.scan(sample, first, (jnp.arange(len(seen)), readings, seen))[1]


READINGS = np.random.default_rng(1).normal(size=(8, 3))
SEEN = [True, True, False, True, True, False, True, True]


def test_a_dead_sensor_reads_nothing_and_a_stuck_one_its_last_reading():
    none = (0.0, (0, 0, 0), 0.0)
    events = failures(
        (0, 1.0, SensorFailureKind.STUCK, *none), (0, 3.0, SensorFailureKind.DEAD, *none)
    )
    found = vectors(events, READINGS, SEEN)
    assert [there for _, there in found] == [True] * 6 + [False] * 2
    for number, source in enumerate([0, 1, 1, 1, 1, 1]):
        np.testing.assert_array_equal(found[number][0], READINGS[source])
    other = vectors(events, READINGS, SEEN, sensor=1)
    assert [there for _, there in other] == SEEN
    unread = vectors(failures((0, 0.0, SensorFailureKind.STUCK, *none)), READINGS, SEEN)
    assert not any(there for _, there in unread)


def test_a_stuck_star_tracker_keeps_its_attitude_in_inertial_axes():
    """Relative to the orbit frame, which turns about its -y, that attitude moves."""
    events = failures((0, 0.4, SensorFailureKind.STUCK, 0.0, (0, 0, 0), 0.0))
    start = np.roll(Rotation.from_rotvec([0.3, -0.5, 0.8]).as_quat(), 1)

    def sample(last, number):
        (condition,) = events.conditions(number, jnp.array(PERIOD), KEY, 1)
        value = jnp.where(number == 0, start, jnp.array([0.0, 1.0, 0.0, 0.0]))
        new = SensorReading(value, jnp.array(True))
        read, last = events.attitude(condition, new, last, jnp.array(True), jnp.array(PERIOD))
        return last, read

    first = SensorReading(jnp.array([1.0, 0.0, 0.0, 0.0]), jnp.array(False))
    read = jax.tree.map(lambda x: x[-1], jax.lax.scan(sample, first, jnp.arange(2001))[1])
    frame = Rotation.from_rotvec([0.0, -RATE * 2000 * PERIOD, 0.0])
    expected = frame.inv() * Rotation.from_quat(np.roll(start, -1))
    found = Rotation.from_quat(np.roll(np.asarray(read.value), -1))
    assert bool(read.seen)
    assert (found.inv() * expected).magnitude() < 1e-7


def test_readings_drift_by_a_small_rotation():
    drift = np.array([0.01, -0.02, 0.03])
    events = failures((0, 1.0, SensorFailureKind.DRIFTING, 0.0, drift, 0.0))
    for number, (value, _) in enumerate(vectors(events, READINGS, [True] * 8)):
        turn = max(number * PERIOD - 1.0, 0.0) * drift
        size = np.linalg.norm(turn)
        exact = turn if size == 0 else turn / size * 2 * np.arctan(size / 2)
        expected = Rotation.from_rotvec(exact).inv().apply(READINGS[number])
        np.testing.assert_allclose(value, expected, atol=1e-12)


@pytest.mark.parametrize("probability", [0.1, 1.0])
def test_spikes_have_their_probability_and_size(probability):
    table = SimpleNamespace(
        kind="spiking", at_s=0.0, drift_rad_s=None, spike_rad=0.2, spike_probability=probability
    )
    events: Any = SensorFailures.from_tables([(0, table)], ExactOrbit(RATE))

    def turn(number):
        return events.conditions(number, jnp.array(PERIOD), KEY, 1)[0].error

    turns = np.asarray(jax.jit(jax.vmap(turn))(jnp.arange(3000)))
    spikes = np.any(turns != 0, axis=1)
    assert abs(spikes.mean() - probability) <= 4 * np.sqrt(probability * (1 - probability) / 3000)
    assert abs(turns[spikes].std() / 0.2 - 1) < 0.1


def gyros(kind, amount=0.0, drift=(0, 0, 0), quantile=0.0):
    """Readings of gyros that fail at 2 s, of rates drawn by NumPy, and whether they are valid."""
    events = GyroFailures([0], [2.0], [kind], [amount], [drift], [quantile])
    return tuple(map(np.asarray, _gyros(Gyro(limit=3.0, failures=events))))


@eqx.filter_jit
def _gyros(gyro):
    def sample(last, now):
        number, rate = now
        read = gyro.read(number, jnp.array(PERIOD), rate, last, KEY)
        return read, (read, gyro.is_valid(number, jnp.array(PERIOD)))

    given = jnp.arange(len(READINGS)), jnp.array(READINGS)
    return jax.lax.scan(sample, jnp.zeros(3), given)[1]


def test_gyros_repeat_their_last_rates_if_stuck_and_are_invalid_if_dead():
    for kind, valid in ((GyroFailureKind.STUCK, 8), (GyroFailureKind.DEAD, 4)):
        read, is_valid = gyros(kind)
        np.testing.assert_array_equal(read, READINGS[[0, 1, 2, 3, 3, 3, 3, 3]])
        np.testing.assert_array_equal(is_valid, np.arange(8) < valid)


def test_rates_of_drifting_and_spiking_gyros_are_off_and_within_their_limit():
    late = np.maximum(PERIOD * np.arange(8) - 2.0, 0)[:, None]
    read, valid = gyros(GyroFailureKind.DRIFTING, drift=(0.5, -4.0, 0.0))
    expected = np.clip(READINGS + late * [0.5, -4.0, 0.0], -3, 3)
    np.testing.assert_allclose(read, expected, atol=1e-15)
    assert np.any(expected == -3)
    assert valid.all()
    read, valid = gyros(GyroFailureKind.SPIKING, 1e-3, quantile=-np.inf)
    error = read - READINGS
    assert not error[:4].any()
    assert np.all((np.abs(error[4:]) > 0) & (np.abs(error[4:]) < 5e-3))
    assert valid.all()


def test_tachometers_fail_each_for_itself():
    kinds = [TachometerFailureKind.STUCK, TachometerFailureKind.DRIFTING]
    events = TachometerFailures([2, 0], [2.0, 1.0], kinds, [0, 0], [[0], [0.3]], [0, 0])
    tachometers = Tachometers([0.0, 0.0, 0.0], failures=events)

    def sample(last, now):
        number, momenta = now
        measured = tachometers(number, ("other", WheelMomenta(momenta)))
        read, last = tachometers.read(number, jnp.array(PERIOD), measured, last)
        assert read[0] == "other"
        return last, (read[1].momentum, tachometers.is_valid(number, jnp.array(PERIOD)))

    given = jnp.arange(len(READINGS)), jnp.array(READINGS)
    read, valid = jax.lax.scan(sample, tachometers.first_readings(), given)[1]
    expected = READINGS.copy()
    expected[4:, 2] = READINGS[3, 2]
    expected[:, 0] += 0.3 * np.maximum(PERIOD * np.arange(8) - 1.0, 0)
    np.testing.assert_allclose(read, expected, atol=1e-15)
    assert np.all(valid)
    dead = TachometerFailures([1], [2.0], [TachometerFailureKind.DEAD], [0], [[0]], [0])
    tachometers = Tachometers([0.0, 0.0, 0.0], failures=dead)
    is_valid = jax.vmap(lambda one: tachometers.is_valid(one, jnp.array(PERIOD)))(jnp.arange(8))
    np.testing.assert_array_equal(is_valid, np.arange(8) < 4)


def test_a_tachometer_that_sticks_in_its_outage_repeats_what_it_read_before():
    events = TachometerFailures([0], [2.0], [TachometerFailureKind.STUCK], [0], [[0]], [0])
    never = [np.inf, np.inf]
    tachometers = Tachometers(
        [0.0] * 3, outage_start=[1.5, *never], outage=[1.0] * 3, failures=events
    )

    @jax.jit
    def sample(number, reading, last):
        measured = tachometers(number, (WheelMomenta(reading),))
        return tachometers.read(number, jnp.array(PERIOD), measured, last)

    last = tachometers.first_readings()
    for number, reading in zip(jnp.arange(8), READINGS, strict=True):
        (read,), last = sample(number, jnp.array(reading), last)
    np.testing.assert_array_equal(read.momentum, [READINGS[2, 0], *READINGS[7, 1:]])
