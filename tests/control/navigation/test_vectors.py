"""Magnetometer and Sun sensor: what they measure, and what the filter makes of it."""

import runpy
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from control.navigation.motion import ORBIT_RATE, attitude_errors, inertial, motion, orbit_frame
from control.navigation.test_filter import (
    BIAS,
    DENSITY,
    GYRO,
    PERIOD,
    WALK,
    covariance,
    normalised_squares,
    tracker,
    within_band,
)
from jaxsat.control.navigation.estimator import AbstractEstimator, Estimate, Measurement
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField, ExactOrbit
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from jaxsat.spacecraft.environment.sensed_vectors import FieldAlongOrbit, Nadir
from jaxsat.spacecraft.vector_sensors import Observation, VectorSensor
from oracle import magnetic as earth
from oracle.attitude_filter import Oracle
from scenario.packages import FROZEN

TILT, NODE, ALONG, GREENWICH = 1.1, 0.4, 0.7, 2.0
ORBIT = CircularOrbit(ORBIT_RATE, TILT, NODE, ALONG, GREENWICH)
SUN = np.array([0.6, -0.64, 0.48])
FIELD_NOISE, SUN_NOISE = 2e-7, 2e-3


def magnetometer(noise=FIELD_NOISE, **others):
    return VectorSensor(FieldAlongOrbit(DipoleField(ORBIT)), "magnetometer", noise, **others)


def sun_sensor(noise=SUN_NOISE, eclipses=False, **others):
    return VectorSensor(Sunlight(SUN, ORBIT, eclipses), "sun sensor", noise, **others)


def filter_of(vectors, seen_by=None, gyro=GYRO):
    latency = max(one.latency for one in vectors)
    noise = tuple(one.noise for one in vectors)
    return MultiplicativeFilter(ExactOrbit(ORBIT_RATE), gyro, seen_by, noise, latency)


@eqx.filter_jit
def _observed(sensor, *arguments):
    return sensor.observed(*arguments)


def observed(sensor, number, attitude, key=(0, 5)):
    arguments = (
        jnp.array(number),
        jnp.array(PERIOD),
        Quaternion(jnp.array(attitude)),
        jnp.array(key, "u4"),
    )
    return jax.tree.map(np.array, _observed(sensor, *arguments))


def body_of(quaternion):
    """The matrix from the orbit frame to the body, by SciPy."""
    return Rotation.from_quat(np.roll(quaternion, -1)).as_matrix().T


def test_the_references_are_field_sun_and_nadir_of_the_orbit():
    """Against the closed forms of the oracle, at an instant of its own."""
    moving, number = motion(PERIOD, 41), 40
    orbit = (ORBIT_RATE, TILT, NODE, ALONG, GREENWICH)
    field = earth.field(number * PERIOD, orbit)
    found = observed(magnetometer(), number, moving.quaternion[number])
    np.testing.assert_allclose(found.reference, field, rtol=1e-6)
    position, velocity = earth.earth.place(number * PERIOD, *orbit[:4])
    sun = earth.earth.orbit_axes(position, velocity) @ SUN
    found = observed(sun_sensor(), number, moving.quaternion[number])
    np.testing.assert_allclose(found.reference, sun, rtol=1e-9)
    nadir = VectorSensor(Nadir(ORBIT), "horizon sensor", 1e-9)
    found = observed(nadir, number, moving.quaternion[number])
    down = earth.earth.orbit_axes(position, velocity) @ position / -np.linalg.norm(position)
    np.testing.assert_allclose(found.reference, down, atol=1e-9)
    np.testing.assert_allclose(found.measured, body_of(moving.quaternion[number]) @ down, atol=1e-8)


@pytest.mark.slow
def test_what_is_measured_has_its_errors():
    attitude = motion(PERIOD, 2).quaternion[1]
    exact = observed(magnetometer(1e-12), 0, attitude)
    true = body_of(attitude) @ exact.reference
    np.testing.assert_allclose(exact.measured, true, atol=1e-11)
    turn, scale, bias = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.0, -0.1]), 1e-6
    wrong = magnetometer(1e-12, bias=bias, scale_factor=scale, misalignment=turn)
    expected = (1 + scale) * (true - np.cross(turn, true)) + bias
    np.testing.assert_allclose(observed(wrong, 0, attitude).measured, expected, atol=1e-11)
    keys = jnp.stack([jnp.arange(2000, dtype=jnp.uint32), jnp.zeros(2000, jnp.uint32)], 1)
    many = jax.vmap(
        lambda key: sun_sensor().observed(
            jnp.array(3), jnp.array(PERIOD), Quaternion(jnp.array(attitude)), key
        )
    )(keys)
    noise = np.asarray(many.measured) - body_of(attitude) @ np.asarray(many.reference[0])
    np.testing.assert_allclose(np.cov(noise.T), SUN_NOISE**2 * np.eye(3), atol=4e-7)


def test_a_sun_sensor_sees_the_sun_in_its_field_of_view_by_day_and_when_it_works():
    def seen(sensor, number, attitude=(1.0, 0.0, 0.0, 0.0)):
        return bool(observed(sensor, number, np.array(attitude)).seen)

    direction = observed(sun_sensor(), 0, np.eye(4)[0]).reference
    away = np.cross(direction, [0.0, 0.0, 1.0])
    for angle, expected in ((0.29, True), (0.31, False)):
        turned = Rotation.from_rotvec(angle * away / np.linalg.norm(away)).apply(direction)
        assert seen(sun_sensor(boresight=5 * turned, half_angle=0.3), 0) == expected
    assert [seen(sun_sensor(every=3), number) for number in range(4)] == [True, False, False, True]
    outage = sun_sensor(outage_start=1.0, outage=0.5)
    assert [seen(outage, number) for number in (9, 10, 14, 15)] == [True, False, False, True]
    again = sun_sensor(outage_start=1.0, outage=0.5, outage_every=2.05)
    assert [seen(again, number) for number in (9, 12, 18, 30, 33, 36, 54)] == [
        True, False, True, True, False, True, False
    ]  # fmt: skip
    radius, earth_radius = float(ORBIT.radius), 6.378137e6
    numbers = np.arange(0, 63000, 2000)
    for number in numbers:
        position, _ = earth.earth.place(number * PERIOD, ORBIT_RATE, TILT, NODE, ALONG)
        position = position / np.linalg.norm(position) * radius
        depth = -position @ SUN
        dark = depth > 0 and np.linalg.norm(position + depth * SUN) < earth_radius
        assert seen(sun_sensor(eclipses=True), number) == (not dark)


def simulated(samples=25, vectors=None):
    """Rates, vectors and attitudes of a tumbling body, with errors by NumPy."""
    generator = np.random.default_rng(4)
    moving, vectors = motion(PERIOD, samples), vectors or (magnetometer(), sun_sensor(every=3))
    rates = moving.omega + 1e-4 + 1e-5 * generator.normal(size=(samples, 3))
    told = []
    for number in range(samples):
        each = [observed(one, number, moving.quaternion[number]) for one in vectors]
        told.append(tuple(each))
    return moving, rates, told


@pytest.mark.parametrize("latency", [2, pytest.param(0, marks=pytest.mark.slow)])
def test_the_filter_with_vectors_is_the_one_in_scipy(latency):
    """Estimates and covariances at every sample, with an attitude now and then besides."""
    _agrees_with_scipy((magnetometer(latency=latency), sun_sensor(every=3)), latency)


STATION = (0.5, 5.0)
"""Latitude and longitude of a beacon, rad, which is in sight at the start of the orbit."""


def beacon(lift=0.0, **others):
    """The sensor of a package's own, which measures the direction to a beacon on the ground."""
    package = runpy.run_path(str(FROZEN / "ground-beacon" / "ground_beacon" / "__init__.py"))
    vector = package["Beacon"](ORBIT, *map(jnp.array, (*STATION, lift)))
    return VectorSensor(vector, "north", 1e-3, **others)


def test_a_beacon_is_where_it_is_and_hides_behind_the_horizon():
    """Against positions in NumPy, along an orbit; what lifts it turns with the body."""
    attitude, (north, east) = motion(PERIOD, 2).quaternion[1], STATION
    across = np.cos(north)
    station = 6.378137e6 * np.array([across * np.cos(east), across * np.sin(east), np.sin(north)])
    sensor, lifted, seen = beacon(), beacon(0.2, misalignment=[0.0, 0.0, 0.01]), []
    for t in np.arange(0.0, 6000.0, 200.0):
        number = round(t / PERIOD)
        position, velocity = earth.earth.place(t, ORBIT_RATE, TILT, NODE, ALONG)
        turned = Rotation.from_euler("Z", GREENWICH + earth.earth.EARTH_ROTATION * t).apply(station)
        line = (turned - position) / np.linalg.norm(turned - position)
        found = observed(sensor, number, attitude)
        expected = earth.earth.orbit_axes(position, velocity) @ line
        np.testing.assert_allclose(found.reference, expected, atol=1e-9)
        seen.append(turned @ line < 0)
        assert found.seen == seen[-1]
        noise = found.measured - body_of(attitude) @ expected
        ideal = body_of(attitude) @ expected + [0.0, 0.0, 0.2]
        ideal = ideal / np.linalg.norm(ideal)
        wrong = observed(lifted, number, attitude).measured
        turn = np.cross([0.0, 0.0, 0.01], ideal)
        np.testing.assert_allclose(wrong, ideal - turn + noise, atol=1e-9)
    assert 0 < seen.count(True) < len(seen)


@pytest.mark.slow
@pytest.mark.parametrize("latency", [0, 2])
def test_the_filter_with_a_vector_of_your_own_is_the_one_in_scipy(latency):
    vectors = (magnetometer(), beacon(every=2, latency=latency))
    _agrees_with_scipy(vectors, latency)


def _agrees_with_scipy(vectors, latency):
    moving, rates, told = simulated(vectors=vectors)
    seen_by = tracker(every=10)
    estimator = filter_of(vectors, seen_by)
    start = Quaternion(moving.quaternion[0]).turned(jnp.array([0.01, -0.02, 0.005]))
    times = PERIOD * np.arange(len(rates))
    oracle = Oracle(
        *(PERIOD, (DENSITY, WALK), np.asarray(covariance(seen_by))),
        *(inertial(np.asarray(start.q), times[0]), 0.02, BIAS),
    )
    memory: Any = estimator.init(start, jnp.array(0.02))
    estimate: Any
    measured, step = {}, eqx.filter_jit(estimator.step)
    for number in range(len(rates)):
        origin = max(number - latency, 0)
        arrived = number >= latency
        attitude = Quaternion(moving.quaternion[origin])
        seen = arrived and origin % 10 == 0
        pairs = tuple(one._replace(seen=one.seen & arrived) for one in told[origin])
        if arrived:
            parts = [inertial(moving.quaternion[origin], times[origin])] if seen else []
            axes = orbit_frame(times[origin])
            parts += [
                (one.measured, axes.apply(one.reference), float(sensor.noise))
                for one, sensor in zip(pairs, vectors, strict=True)
                if one.seen
            ]
            measured[origin] = parts
        arriving = jax.tree.map(jnp.asarray, pairs)
        measurement = Measurement(jnp.array(rates[number]), attitude, jnp.array(seen), arriving)
        estimate, memory = step(jnp.array(number), jnp.array(PERIOD), measurement, memory)
        attitude, bias, matrix = oracle.run(rates[: number + 1], measured)
        believed = inertial(np.asarray(estimate.attitude.q), times[number])
        np.testing.assert_allclose((believed.inv() * attitude).as_rotvec(), 0, atol=1e-12)
        np.testing.assert_allclose(estimate.bias, bias, atol=1e-12)
        deviations = np.sqrt(np.diag(np.asarray(matrix)))
        np.testing.assert_allclose(estimate.attitude_sigma, deviations[:3], rtol=1e-7)
        np.testing.assert_allclose(estimate.bias_sigma, deviations[3:6], rtol=1e-7)


def test_of_two_vectors_it_makes_what_wahba_s_problem_does():
    """One sample of a filter that knew little: SciPy's weighted attitude (Wahba, SIAM Review 7(3),
    1965) within a hundredth of its deviation, and the inverse of the information as covariance."""
    attitude = motion(PERIOD, 2).quaternion[0]
    vectors = (magnetometer(3e-8), sun_sensor(1e-3))
    told = [observed(one, 0, attitude) for one in vectors]
    sizes = [np.linalg.norm(one.reference) for one in told]
    weights = [(size / float(one.noise)) ** 2 for size, one in zip(sizes, vectors, strict=True)]
    units = [
        np.array([one / np.linalg.norm(one) for one in each])
        for each in ([one.measured for one in told], [one.reference for one in told])
    ]
    wahba = Rotation.align_vectors(*units, weights=weights)[0]
    estimator = filter_of(vectors)
    start = Quaternion(attitude).turned(jnp.array([1e-3, -2e-3, 5e-4]))
    pairs = tuple(Observation(*map(jnp.asarray, one)) for one in told)
    measurement = Measurement(jnp.zeros(3), None, None, pairs)
    arguments = (
        jnp.array(0),
        jnp.array(PERIOD),
        measurement,
        estimator.init(start, jnp.array(1.0)),
    )
    estimate, memory = eqx.filter_jit(estimator.step)(*arguments)
    expected = np.roll(wahba.inv().as_quat(), 1)
    off = attitude_errors(expected, np.asarray(estimate.attitude.q))
    assert np.all(np.abs(off) < 0.01 * np.asarray(estimate.attitude_sigma))
    across = [np.eye(3) - np.outer(v, v) for v in (body_of(expected) @ units[1].T).T]
    information = np.eye(3) + sum(w * one for w, one in zip(weights, across, strict=True))
    np.testing.assert_allclose(
        memory.belief.attitude, np.linalg.inv(information), rtol=0.02, atol=1e-9
    )


@eqx.filter_jit
def _flown(navigation, keys, moving):
    def one(key):
        own = eqx.tree_at(lambda navigation: navigation.key, navigation, key)

        def sample(state, number):
            plant = PlantState(Quaternion(moving.quaternion[number]), moving.omega[number])
            estimate, after = own.step(number, jnp.array(PERIOD), plant, state)
            return after, (estimate, after.memory.belief, state.bias)

        first = own.init(PlantState(Quaternion(moving.quaternion[0]), moving.omega[0]))
        return jax.lax.scan(sample, first, jnp.arange(len(moving.omega)))[1]

    return jax.vmap(one)(keys)


def flown(cases, declared, samples=601, vectors=None):
    """The motion, and estimates, beliefs and true biases of runs without a star tracker.

    The sensors are `vectors`, by default those `declared` to the filter.
    """
    moving = motion(PERIOD, samples)
    navigation = Navigation(GYRO, None, filter_of(declared), 0.01, (0, 0), vectors or declared)
    keys = jnp.stack([jnp.arange(cases, dtype=jnp.uint32), jnp.full(cases, 7, jnp.uint32)], 1)
    return moving, *_flown(navigation, keys, jax.tree.map(jnp.asarray, moving))


@pytest.mark.slow
def test_errors_are_as_large_as_the_filter_claims():
    """NEES of the six states in its χ² band without a star tracker."""
    moving, _, belief, biases = flown(300, (magnetometer(), sun_sensor(every=3)))
    for number in (0, 1, 3, 20, 150, 300, 599, 600):
        squares = normalised_squares(moving, belief, biases, number)
        assert within_band(squares, 6), (number, squares.mean())


@pytest.mark.slow
def test_noise_that_is_not_declared_is_told_apart():
    noisy = sun_sensor(3 * SUN_NOISE, every=3)
    declared = (magnetometer(), sun_sensor(every=3))
    moving, _, belief, biases = flown(300, declared, vectors=(declared[0], noisy))
    assert not within_band(normalised_squares(moving, belief, biases, 600), 6)


class Listener(AbstractEstimator):
    """Keeps what it is told last."""

    def init(self, attitude, sigma):
        return attitude

    def step(self, sample, period, measurement, memory):
        seen: Any = measurement.attitude
        return Estimate(seen, measurement.rate), measurement


@pytest.mark.slow
def test_all_that_is_measured_at_a_sample_is_delivered_with_the_slowest():
    """A tracker without latency waits for a magnetometer with three samples of it."""
    slow = magnetometer(latency=3)
    navigation = Navigation(GYRO, tracker(every=1), Listener(), 0.01, (0, 0), (slow,))
    moving, step, told = motion(PERIOD, 6), eqx.filter_jit(navigation.step), []
    plants = [
        PlantState(Quaternion(q), jnp.array(w))
        for q, w in zip(moving.quaternion, moving.omega, strict=True)
    ]
    state = navigation.init(plants[0])
    for number, plant in enumerate(plants):
        _, state = step(jnp.array(number), jnp.array(PERIOD), plant, state)
        told.append(state.memory)
    assert [bool(one.seen) for one in told] == [False] * 3 + [True] * 3
    assert [bool(one.vectors[0].seen) for one in told] == [False] * 3 + [True] * 3
    for number in (3, 4, 5):
        origin = number - 3
        off = attitude_errors(moving.quaternion[origin], np.asarray(told[number].attitude.q))
        assert np.abs(off).max() < 1e-3
        expected = observed(slow, origin, moving.quaternion[origin], (0, 0))
        np.testing.assert_allclose(told[number].vectors[0].measured, expected.measured, rtol=1e-12)
