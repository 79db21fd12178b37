"""The test of innovations against one in SciPy, chi-squared bands, and sensors that fail."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binom, chi2, ncx2, norm

from control.navigation.motion import ORBIT_RATE, inertial, motion, orbit_frame
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
from control.navigation.test_vectors import filter_of, magnetometer, simulated, sun_sensor
from jaxsat.control.navigation.estimator import Measurement
from jaxsat.control.navigation.innovation import InnovationTest, threshold
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.sensor import SensorFailureKind
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.sensor_failures import SensorFailures
from oracle.attitude_filter import Oracle


@pytest.mark.parametrize("degrees", [2, 3])
@pytest.mark.parametrize("probability", [0.5, 0.05, 1e-3, 1e-6, 1e-12])
def test_thresholds_are_those_of_scipy(probability, degrees):
    expected = chi2.isf(probability, degrees)
    np.testing.assert_allclose(threshold(probability, degrees), expected, rtol=1e-10)


def test_what_is_no_probability_or_patience_is_refused():
    for probability in (0.0, 1.0, np.nan):
        with pytest.raises(ArgumentError, match="false_alarm_probability"):
            InnovationTest(probability, 5)
    with pytest.raises(ArgumentError, match="patience"):
        InnovationTest(0.01, 0)
    with pytest.raises(ArgumentError, match="probation"):
        InnovationTest(0.01, 1, 0)


class StrictOracle(Oracle):
    """Leaves out what has a normalised squared innovation above the quantile of χ².

    `squares` are the last ones of each sensor over the quantile, `history` tells whether each of
    its readings was good; a sensor is told by the deviation of its vectors, the tracker by None.
    """

    def __init__(self, *arguments, probability, patience, probation):
        super().__init__(*arguments)
        self.probability, self.patience, self.probation = probability, patience, probation

    def noted(self):
        return dict(self.squares), {sensor: list(one) for sensor, one in self.history.items()}

    def recall(self, noted):
        squares, history = noted or ({}, {})
        self.squares = dict(squares)
        self.history = {sensor: list(one) for sensor, one in history.items()}

    def told(self, sensor):
        """Whether a sensor is excluded, its rejected readings, and how often it was excluded, from
        the list of all its readings."""
        excluded, rejected, times, begin = False, 0, 0, 0
        readings = self.history.get(sensor, [])
        for end, good in enumerate(readings, 1):
            rejected += not (excluded or good)
            count = self.probation if excluded else self.patience
            last = readings[max(begin, end - count) : end]
            if len(last) == count and all(one == excluded for one in last):
                excluded, begin = not excluded, end
                times += excluded
        return excluded, rejected, times

    def after_attitude(self, state, measured):
        self.now = (None, 3)
        return super().after_attitude(state, measured)

    def after_vector(self, state, measured, reference, deviation):
        self.now = (deviation, 2)
        return super().after_vector(state, measured, reference, deviation)

    def updated(self, state, error, rows, noise):
        sensor, degrees = self.now
        innovation = rows @ error
        matrix = rows @ state[2][:3, :3] @ rows.T + noise
        square = innovation @ np.linalg.inv(matrix) @ innovation
        limit = chi2.isf(self.probability, degrees)
        self.squares[sensor] = square / limit
        excluded = self.told(sensor)[0]
        self.history.setdefault(sensor, []).append(square <= limit)
        unused = excluded or square > limit
        return state if unused else super().updated(state, error, rows, noise)


@pytest.mark.slow
@pytest.mark.parametrize("latency", [2, 0])
def test_the_filter_leaves_out_what_one_in_scipy_does(latency):
    """A tracker that is off from the first for a while, single wrong fields, and noise that a high
    probability of a false alarm leaves out now and then. The tracker is excluded, and returns."""
    count = 46
    moving, rates, told = simulated(count)
    generator, seen_by = np.random.default_rng(8), tracker(every=3)
    vectors = (magnetometer(latency=latency), sun_sensor(every=3))
    test = InnovationTest(0.2, 2, 3)
    estimator = dataclasses.replace(filter_of(vectors, seen_by), test=test)
    start = Quaternion(moving.quaternion[0]).turned(jnp.array([0.01, -0.02, 0.005]))
    times = PERIOD * np.arange(len(rates))
    oracle = StrictOracle(
        *(PERIOD, (DENSITY, WALK), np.asarray(covariance(seen_by))),
        *(inertial(np.asarray(start.q), times[0]), 0.02, BIAS),
        probability=0.2,
        patience=2,
        probation=3,
    )
    sensors = (None, *(float(one.noise) for one in vectors))
    memory: Any = estimator.init(start, jnp.array(0.02))
    estimate: Any
    measured, left_out, step = {}, set(), eqx.filter_jit(estimator.step)
    excluded: list[bool] = []
    for number in range(len(rates)):
        origin, arrived = max(number - latency, 0), number >= latency
        size = 0.3 if 9 < origin < 20 else 3e-5
        off = Rotation.from_rotvec(size * generator.normal(size=3))
        turned = Rotation.from_quat(np.roll(moving.quaternion[origin], -1)) * off
        attitude = np.roll(turned.as_quat(), 1)
        seen = arrived and origin % 3 == 0
        pairs = [one._replace(seen=one.seen & arrived) for one in told[origin]]
        if origin in (6, 7, 14):
            wrong = Rotation.from_rotvec([0.5, -0.4, 0.3]).apply(pairs[0].measured)
            pairs[0] = pairs[0]._replace(measured=wrong)
        if arrived:
            parts = [inertial(attitude, times[origin])] if seen else []
            axes = orbit_frame(times[origin])
            parts += [
                (np.asarray(one.measured), axes.apply(one.reference), float(sensor.noise))
                for one, sensor in zip(pairs, vectors, strict=True)
                if one.seen
            ]
            measured[origin] = parts
        arriving = jax.tree.map(jnp.asarray, tuple(pairs))
        given = (jnp.array(rates[number]), Quaternion(jnp.array(attitude)), jnp.array(seen))
        measurement = Measurement(*given, arriving)
        estimate, memory = step(jnp.array(number), jnp.array(PERIOD), measurement, memory)
        attitude, bias, matrix = oracle.run(rates[: number + 1], measured)
        believed = inertial(np.asarray(estimate.attitude.q), times[number])
        np.testing.assert_allclose((believed.inv() * attitude).as_rotvec(), 0, atol=1e-12)
        np.testing.assert_allclose(estimate.bias, bias, atol=1e-12)
        deviations = np.sqrt(np.diag(np.asarray(matrix)))
        np.testing.assert_allclose(estimate.attitude_sigma, deviations[:3], rtol=1e-7)
        squares = [oracle.squares.get(one, 0.0) for one in sensors]
        np.testing.assert_allclose(estimate.innovation, squares, rtol=1e-6, atol=1e-12)
        states = np.array([oracle.told(one) for one in sensors])
        np.testing.assert_array_equal(estimate.excluded, states[:, 0])
        counts = estimator.counts(memory)
        np.testing.assert_array_equal(counts["rejected_readings"], states[:, 1])
        np.testing.assert_array_equal(counts["sensor_exclusions"], states[:, 2])
        excluded.append(bool(states[0, 0]))
        left_out |= {place for place, square in enumerate(squares) if square > 1}
    assert left_out == {0, 1, 2}
    assert np.count_nonzero(np.diff(excluded)) == 2  # once, and then used again
    assert not excluded[-1]


def failures(kind, at, number=0, drift=(0, 0, 0), size=0.0, quantile=0.0):
    """One failure of a sensor, which is turning with the orbit frame as the filter believes."""
    return SensorFailures(
        [number], [at], [kind], [size], [drift], [quantile], ExactOrbit(ORBIT_RATE)
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


def flown(
    cases, failing=None, probability: float | None = 1e-4, patience=3, first=0, probation=100
):
    """The motion, and estimates, beliefs and true biases of runs with three sensors."""
    moving, seen_by = motion(PERIOD, 601), tracker()
    vectors = (magnetometer(every=2), sun_sensor(every=3))
    estimator = filter_of(vectors, seen_by)
    if probability is not None:
        test = InnovationTest(probability, patience, probation)
        estimator = dataclasses.replace(estimator, test=test)
    navigation = Navigation(GYRO, seen_by, estimator, 0.01, (0, 0), vectors, failing)
    numbers = first + jnp.arange(cases, dtype=jnp.uint32)
    keys = jnp.stack([numbers, jnp.full(cases, 7, jnp.uint32)], 1)
    return moving, *_flown(navigation, keys, jax.tree.map(jnp.asarray, moving))


EVERY = (5, 2, 3)
"""Samples between two readings of tracker, magnetometer and Sun sensor."""


@pytest.mark.slow
def test_good_readings_are_rejected_as_often_as_told():
    """Of 400 flights, each sensor in its binomial band of 1 - 1e-4; NEES in that of χ²."""
    probability = 2e-3
    moving, estimate, belief, biases = flown(400, probability=probability, patience=10**6)
    for place, every in enumerate(EVERY):
        squares = np.asarray(estimate.innovation)[:, ::every, place]
        low, high = binom.ppf([0.5e-4, 1 - 0.5e-4], squares.size, probability)
        assert low <= (squares > 1).sum() <= high, (place, (squares > 1).mean())
    assert not np.asarray(estimate.excluded).any()
    for number in (5, 20, 150, 300, 599, 600):
        squares = normalised_squares(moving, belief, biases, number)
        assert within_band(squares, 6), (number, squares.mean())


@pytest.mark.slow
@pytest.mark.parametrize("size", [2.5, 4.5, 6.0])
def test_a_wrong_reading_is_found_as_often_as_the_closed_form_says(size):
    """One attitude of the tracker turned by some deviations: noncentral χ² of three degrees."""
    turn = size * 4e-5 * np.array([0.0, 1.0, 0.0])
    cases, last = 400, 600
    failing = failures(SensorFailureKind.DRIFTING, (last - 1) * PERIOD, drift=turn / PERIOD)
    _, estimate, belief, _ = flown(cases, failing, probability=1e-2)
    found = np.asarray(estimate.innovation)[:, last, 0] > 1
    before = np.asarray(belief.attitude)[found, last].mean(axis=0)  # nothing else is read then
    matrix = before + np.asarray(covariance(tracker()))
    expected = ncx2.sf(chi2.isf(1e-2, 3), 3, turn @ np.linalg.solve(matrix, turn))
    low, high = binom.ppf([0.5e-4, 1 - 0.5e-4], cases, expected)
    assert low <= found.sum() <= high, (found.mean(), expected)


KINDS = {
    "stuck": failures(SensorFailureKind.STUCK, 20.0),
    "drifting": failures(SensorFailureKind.DRIFTING, 20.0, drift=(0.01, -0.02, 0.01)),
    "spiking": failures(SensorFailureKind.SPIKING, 20.0, size=0.3, quantile=0.5),
    "dead": failures(SensorFailureKind.DEAD, 20.0),
    "stuck magnetometer": failures(SensorFailureKind.STUCK, 20.0, 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_errors_are_as_large_as_claimed_whatever_fails(name):
    """NEES of the six states in its χ² band before and after, and who is excluded."""
    moving, estimate, belief, biases = flown(300, KINDS[name])
    for number in (150, 205, 300, 600):
        squares = normalised_squares(moving, belief, biases, number)
        assert within_band(squares, 6), (number, squares.mean())
    excluded = np.asarray(estimate.excluded)
    assert not excluded[:, :200].any()
    expected = {"stuck": [1, 0, 0], "drifting": [1, 0, 0], "stuck magnetometer": [0, 1, 0]}
    if name == "spiking":  # about three in ten readings, so three in a row come sooner or later
        assert excluded[:, 600, 0].mean() > 0.5
        assert not excluded[:, 600, 1:].any()
    else:
        np.testing.assert_array_equal(
            excluded[:, 600], np.tile(expected.get(name, [0, 0, 0]), (300, 1))
        )


@pytest.mark.slow
def test_a_sensor_returns_after_a_passing_fault_and_errors_stay_as_large_as_claimed():
    """The tracker is stuck from 20 s to 30 s; with readings twice a second it returns at 40 s."""
    kinds = [SensorFailureKind.STUCK, SensorFailureKind.DRIFTING]
    none = [0, 0]
    passing = SensorFailures(
        none, [20.0, 30.0], kinds, none, [(0, 0, 0)] * 2, none, ExactOrbit(ORBIT_RATE)
    )
    moving, estimate, belief, biases = flown(300, passing, probation=20)
    for number in (205, 300, 395, 405, 600):
        squares = normalised_squares(moving, belief, biases, number)
        assert within_band(squares, 6), (number, squares.mean())
    excluded = np.asarray(estimate.excluded)
    assert excluded[:, 215:395, 0].all()
    returned = 1 - excluded[:, 600, 0]
    assert returned.sum() >= binom.ppf(0.5e-4, 300, (1 - 1e-4) ** 20)
    assert not excluded[:, 600, 1:].any()


@pytest.mark.slow
def test_a_sensor_that_fails_at_random_returns_with_the_probability_of_a_run_of_good_readings():
    """Exclusions of a tracker of which three in ten readings are spikes, by a Markov chain."""
    patience, probation, cases, first, spike = 3, 4, 300, 40, norm.sf(0.5)
    _, estimate, *_ = flown(cases, KINDS["spiking"], 1e-6, patience, probation=probation)
    excluded = np.asarray(estimate.excluded)[:, :: EVERY[0], 0]
    readings = excluded.shape[1] - first
    states = np.zeros((patience + probation, patience + probation))
    for state in range(patience + probation):
        good = 0 if state < patience else (state + 1) % (patience + probation)
        bad = state + 1 if state < patience else patience
        states[state, good] += 1 - spike
        states[state, bad] += spike
    chance = np.eye(patience + probation)[0]
    for number in range(readings):
        chance = chance @ states
        low, high = binom.ppf([0.5e-5, 1 - 0.5e-5], cases, chance[patience:].sum())
        assert low <= excluded[:, first + number].sum() <= high, number


@pytest.mark.slow
def test_without_the_test_a_stuck_tracker_is_believed():
    moving, _, belief, biases = flown(20, KINDS["stuck"], probability=None)
    assert not within_band(normalised_squares(moving, belief, biases, 600), 6)


@pytest.mark.slow
def test_a_case_alone_has_the_numbers_that_it_has_in_a_batch():
    batch, alone = (flown(*some)[1:] for some in ((8, KINDS["spiking"]), (1, KINDS["spiking"])))
    for one, other in zip(jax.tree.leaves(batch), jax.tree.leaves(alone), strict=True):
        np.testing.assert_allclose(one[:1], other, rtol=1e-9, atol=1e-13)
