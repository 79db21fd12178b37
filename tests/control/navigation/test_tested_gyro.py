"""A gyro as a sensor of the filter by the dynamics: against SciPy, χ² bands, and what fails."""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from control.navigation.dynamics import (
    AXES,
    INERTIA,
    PERIOD,
    RATE_SIGMA,
    TORQUES,
    flights,
    navigation_of,
    watched,
)
from control.navigation.motion import ORBIT_RATE, inertial
from control.navigation.test_dynamics_filter import normalised_squares
from control.navigation.test_filter import covariance, tracker, within_band
from control.navigation.test_innovations import failures
from control.navigation.test_vectors import magnetometer, sun_sensor
from jaxsat.control.navigation.estimator import Measurement
from jaxsat.control.navigation.innovation import InnovationTest
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.sensor import GyroFailureKind, SensorFailureKind
from jaxsat.spacecraft.navigation_sensors import Gyro
from jaxsat.spacecraft.sensor_failures import GyroFailures
from oracle.dynamics_filter import DynamicsOracle

DENSITY, WALK, BIAS = 2e-5, 3e-7, 1e-4
GYRO = Gyro(DENSITY, WALK, bias_sigma=BIAS)
PATIENCE, PROBATION = 2, 3
WRONG = range(9, 15)
"""Samples at which the gyro is off: it is excluded by the second, and good again from 15 on."""
UNUSED = range(9, 18)


@pytest.mark.parametrize("latency", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_the_filter_is_the_one_written_in_scipy(latency):
    """Estimates and covariances at every sample, with a gyro that is excluded and used again."""
    seen_by, noise, count = tracker(every=4, latency=latency), 1e-3, 26
    (flight,) = zip(*flights(1, count, wheels=4), strict=True)
    omega, quaternion, torque, _, momentum = flight
    rng = np.random.default_rng(3)
    stored = (momentum + noise * rng.normal(size=momentum.shape)) @ AXES.T
    rates = omega + 1e-4 + 3e-5 * rng.normal(size=omega.shape)
    rates[WRONG] += [0.01, -0.02, 0.01]
    times = PERIOD * np.arange(count)
    measured = Rotation.from_quat(np.roll(quaternion, -1, axis=1))
    measured = measured * Rotation.from_rotvec(4e-5 * rng.normal(size=(count, 3)))
    relatives = np.roll(measured.as_quat(), 1, axis=1)
    start = Quaternion(quaternion[0]).turned(jnp.array([0.01, -0.02, 0.005]))
    first = inertial(np.asarray(start.q), times[0])
    model = [float(one) for one in (TORQUES.noise, TORQUES.sigma, TORQUES.walk)]
    oracle = DynamicsOracle(
        *(PERIOD, INERTIA, model, noise**2 * AXES @ AXES.T, np.asarray(covariance(seen_by))),
        *(first, first.inv().apply([0.0, -ORBIT_RATE, 0.0]), (0.02, RATE_SIGMA)),
        (DENSITY, WALK, BIAS),
    )
    test = InnovationTest(1e-9, PATIENCE, PROBATION)
    estimator: Any = navigation_of(seen_by, wheels=4, noise=noise, test=test, gyro=GYRO).estimator
    memory, step = estimator.init(start, jnp.array(0.02)), eqx.filter_jit(estimator.step)
    attitudes, used, excluded = {}, {}, []
    for number in range(count):
        origin = number - latency
        seen = origin >= 0 and origin % 4 == 0
        if seen:
            attitudes[origin] = inertial(relatives[origin], times[origin])
        if number not in UNUSED:
            used[number] = rates[number]
        measurement = Measurement(
            *(jnp.array(rates[number]), Quaternion(relatives[max(origin, 0)]), jnp.array(seen), ()),
            *(jnp.array(torque[number]), jnp.array(stored[number])),
        )
        estimate, memory = step(jnp.array(number), jnp.array(PERIOD), measurement, memory)
        attitude, others, matrix = oracle.run(stored[: number + 1], torque, attitudes, used)
        believed = inertial(np.asarray(estimate.attitude.q), times[number])
        np.testing.assert_allclose((believed.inv() * attitude).as_rotvec(), 0, atol=1e-10)
        np.testing.assert_allclose(estimate.omega, others[:3], atol=1e-12)
        np.testing.assert_allclose(estimate.bias, others[9:], atol=1e-12)
        deviations = np.sqrt(np.diag(matrix))
        np.testing.assert_allclose(estimate.attitude_sigma, deviations[:3], rtol=1e-8)
        np.testing.assert_allclose(estimate.rate_sigma, deviations[3:6], rtol=1e-8)
        np.testing.assert_allclose(estimate.bias_sigma, deviations[12:], rtol=1e-8)
        if not latency:
            np.testing.assert_allclose(memory.belief.torque, others[3:6], atol=1e-10)
            order = [*range(9), *range(12, 15), *range(9, 12)]
            expected = matrix[np.ix_(order, order)]
            np.testing.assert_allclose(memory.belief.covariance, expected, rtol=1e-7, atol=1e-16)
            mean = mean_of(oracle.white, number)
            np.testing.assert_allclose(memory.record.mean, mean, rtol=1e-6, atol=1e-9)
        excluded.append(np.asarray(estimate.excluded))
    np.testing.assert_array_equal(np.flatnonzero(np.array(excluded)[:, 1]), UNUSED[1:-1])
    assert not np.array(excluded)[:, 0].any()


def mean_of(white, number):
    """The mean of the innovations since the gyro is used; 0 while it is excluded."""
    first = 0 if number < UNUSED[-1] else UNUSED[-1] + 1
    mean = np.zeros(3)
    for one in range(first, number + 1):
        mean = 0.99 * mean + 0.01 * white[one] if one in white else mean
    return 0 * mean if number in UNUSED[1:] else mean


def test_the_tested_square_is_that_of_scipy():
    """νᵀS⁻¹ν of the first rate, over the quantile of χ² with three degrees of freedom."""
    seen_by, test = tracker(), InnovationTest(1e-3)
    estimator: Any = navigation_of(seen_by, test=test, gyro=GYRO).estimator
    upright = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))
    rate = np.array([0.004, -0.011, 0.006])
    measurement = Measurement(
        jnp.array(rate), upright, jnp.array(False), torque=jnp.zeros(3), momentum=None
    )
    begin = estimator.init(upright, jnp.array(0.02))
    estimate, _ = estimator.step(jnp.array(0), jnp.array(PERIOD), measurement, begin)
    off = rate - [0.0, -ORBIT_RATE, 0.0]
    variance = RATE_SIGMA**2 + BIAS**2 + DENSITY**2 / PERIOD + WALK**2 * PERIOD / 12
    expected = off @ off / variance / chi2.isf(1e-3, 3)
    np.testing.assert_allclose(estimate.innovation[1], expected, rtol=1e-9)


def test_a_rate_at_the_limit_or_invalid_is_left_out():
    gyro = dataclasses.replace(GYRO, limit=0.01)
    estimator: Any = navigation_of(tracker(), gyro=gyro).estimator
    upright = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))
    begin = estimator.init(upright, jnp.array(0.02))

    def rates(rate, valid):
        given = Measurement(jnp.array(rate), upright, jnp.array(False), torque=jnp.zeros(3))
        given = given._replace(valid=jnp.array(valid))
        return np.asarray(estimator.step(jnp.array(0), jnp.array(PERIOD), given, begin)[0].omega)

    unseen = [0.0, -ORBIT_RATE, 0.0]
    np.testing.assert_allclose(rates([0.004, 0.01, 0.0], True), unseen, atol=1e-18)
    np.testing.assert_allclose(rates([0.004, 0.005, 0.0], False), unseen, atol=1e-18)
    assert np.abs(rates([0.004, 0.005, 0.0], True) - unseen).max() > 1e-3


def gyro_failure(kind, drift=(0, 0, 0), size=0.0, quantile=0.0):
    return GyroFailures([0], [50.0], [kind], [size], [drift], [quantile])


KINDS = {
    "dead": gyro_failure(GyroFailureKind.DEAD),
    "stuck": gyro_failure(GyroFailureKind.STUCK),
    "drifting": gyro_failure(GyroFailureKind.DRIFTING, drift=(1e-3, 0.0, -1e-3)),
    "spiking": gyro_failure(GyroFailureKind.SPIKING, size=0.1, quantile=0.5),
}
SETS = {
    "star tracker": (tracker(every=2), (), 0, 0.0),
    "late star tracker": (tracker(every=3, latency=2), (), 0, 0.0),
    "magnetometer and Sun sensor": (None, (magnetometer(), sun_sensor()), 0, 0.0),
    "star tracker and tachometers": (tracker(every=2), (), 4, 2e-3),
}
CHECKS = [("star tracker", kind) for kind in (None, *KINDS)] + [
    (name, kind) for name in list(SETS)[1:] for kind in (None, "stuck")
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), CHECKS)
def test_errors_are_as_large_as_the_filter_claims(name, kind):
    """NEES of the twelve states in its χ² band, before a gyro fails at 50 s and after."""
    seen_by, vectors, wheels, noise = SETS[name]
    flown = flights(150, 201, wheels)
    gyro = GYRO if kind is None else dataclasses.replace(GYRO, failures=KINDS[kind])
    navigation = navigation_of(
        *(seen_by, vectors, wheels, noise), test=InnovationTest(1e-6), gyro=gyro
    )
    estimates, belief, biases = watched(navigation, flown, noise)
    estimator: Any = navigation.estimator
    latency = estimator.latency
    late = {part: np.roll(getattr(flown, part), latency, axis=1) for part in flown._fields}
    for number in (latency, 3, 10, 50, 99, 130, 150, 199, 200):
        squares = normalised_squares(
            flown._replace(**late), belief, number, np.roll(biases, latency, axis=1)
        )
        assert within_band(squares, 12), (number, squares.mean())
    excluded = np.asarray(estimates.excluded)
    assert not excluded[..., :-1].any()
    assert not excluded[:, :99].any()
    if kind in ("stuck", "drifting"):
        assert excluded[:, 130:, -1].all()
    elif kind != "spiking":
        assert not excluded.any()


@pytest.mark.slow
def test_a_tracker_that_fails_is_excluded_beside_a_gyro():
    """NEES, before the failure at 25 s and after, with the gyro alone beside the dynamics."""
    flown = flights(150, 201)
    wrong = failures(SensorFailureKind.STUCK, 25.0)
    test = InnovationTest(1e-6)
    navigation = navigation_of(tracker(every=2), test=test, failures=wrong, gyro=GYRO)
    estimates, belief, biases = watched(navigation, flown)
    excluded = np.asarray(estimates.excluded)
    assert not excluded[:, :50].any()
    assert excluded[:, 80:, 0].all()
    assert not excluded[..., 1].any()
    for number in (40, 100, 200):
        squares = normalised_squares(flown, belief, number, biases)
        assert within_band(squares, 12), (number, squares.mean())
