"""Gyro and star tracker as they are declared; the estimator that is none."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.navigation.motion import attitude_errors, motion
from jaxsat.control.navigation.estimator import RawMeasurements
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.attitude import WZ, Quaternion
from jaxsat.core.noise import sample_noise
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker

PERIOD = 0.1
STILL = Quaternion([1.0, 0.0, 0.0, 0.0])


def rates_of(gyro, cases, samples, omega):
    """Measured rates and biases of several gyros, the truth standing still."""

    def one(key):
        def sample(bias, number):
            noise = sample_noise(key, number, 6)
            rate = gyro.measured(omega, bias, noise[:3], jnp.array(PERIOD))
            return gyro.next_bias(bias, noise[3:], jnp.array(PERIOD)), (rate, bias)

        first = gyro.first_bias(sample_noise(key, jnp.array(2**31), 3))
        return jax.lax.scan(sample, first, jnp.arange(samples))[1]

    keys = jnp.arange(2 * cases, dtype=jnp.uint32).reshape(cases, 2)
    return eqx.filter_jit(jax.vmap(one))(keys)


def test_allan_variance_is_that_of_both_random_walks():
    """σv²/τ + σu²τ/3 (IEEE Std 952, annex C), for τ from one sample to a hundred seconds."""
    density, walk = 1e-4, 2e-5
    gyro = Gyro(density, walk, bias=[0.1, -0.2, 0.3])
    rates, _ = rates_of(gyro, 150, 3000, jnp.zeros(3))
    for count in (1, 10, 50, 200, 1000):
        tau = count * PERIOD
        means = np.asarray(rates).reshape(150, -1, count, 3).mean(axis=2)
        allan = (np.diff(means, axis=1) ** 2).mean() / 2
        within = 0.03 if count < 1000 else 0.15  # two differences a run are left
        assert allan == pytest.approx(density**2 / tau + walk**2 * tau / 3, rel=within)


def test_the_bias_starts_as_declared_and_walks():
    gyro = Gyro(0.0, 2e-5, bias=[0.1, -0.2, 0.3], bias_sigma=1e-4)
    _, biases = rates_of(gyro, 2000, 401, jnp.zeros(3))
    off = np.asarray(biases) - [0.1, -0.2, 0.3]
    for number in (0, 100, 400):
        expected = 1e-4**2 + 2e-5**2 * PERIOD * number
        assert off[:, number].var() == pytest.approx(expected, rel=0.06)
        assert abs(off[:, number].mean()) < 4 * np.sqrt(expected / 6000)


def test_scale_factor_misalignment_and_saturation():
    gyro = Gyro(scale_factor=[0.01, 0.0, -0.02], misalignment=[0.0, 0.0, 0.001], limit=0.5)
    none, period = jnp.zeros(3), jnp.array(PERIOD)
    found = gyro.measured(jnp.array([0.1, 0.2, 0.3]), none, none, period)
    # axes turned by +1 mrad about z: x is where 1 mrad of y adds to it
    np.testing.assert_allclose(found, [1.01 * (0.1 + 2e-4), 0.2 - 1e-4, 0.98 * 0.3], rtol=1e-12)
    held = gyro.measured(jnp.array([2.0, -3.0, 0.1]), none, none, period)
    np.testing.assert_allclose(held, [0.5, -0.5, 0.098], rtol=1e-12)


def test_the_tracker_is_less_sure_about_its_boresight():
    boresight = np.array([1.0, 2.0, -2.0]) / 3
    tracker = StarTracker(1e-4, 1e-3, 7 * boresight)
    noise = jnp.array(np.random.default_rng(1).normal(size=(20000, 3)))
    measured = jax.vmap(lambda noise: tracker.measured(STILL, noise).q)(noise)
    errors = attitude_errors(np.asarray(measured), np.asarray(STILL.q)[None])
    expected = 1e-4**2 * np.eye(3) + (1e-3**2 - 1e-4**2) * np.outer(boresight, boresight)
    np.testing.assert_allclose(errors.T @ errors / len(errors), expected, atol=3e-8)
    np.testing.assert_allclose(tracker.axes @ tracker.axes.T, np.eye(3), atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"across": 0.0, "along": 1e-4}, "across"),
        ({"across": 1e-4, "along": 1e-4, "boresight": [0, 0, 0]}, "boresight"),
        ({"across": 1e-4, "along": 1e-4, "every": 0}, "every"),
        ({"across": 1e-4, "along": 1e-4, "latency": -1}, "latency"),
        ({"across": 1e-4, "along": 1e-4, "rate_limit": 0.0}, "rate_limit"),
    ],
)
def test_impossible_trackers_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        StarTracker(**arguments)


def test_impossible_gyros_are_refused():
    for name in ("noise_density", "bias_walk", "bias_sigma", "limit"):
        with pytest.raises(ValueError, match=name):
            Gyro(**{name: -1.0})


def raw(samples, every, latency, rate_limit=np.inf):
    """What a law is told of a tumbling body without an estimator, and the truth."""
    tracker = StarTracker(1e-9, 1e-9, every=every, latency=latency, rate_limit=rate_limit)
    navigation = Navigation(Gyro(), tracker, RawMeasurements(), 0.1)
    moving = motion(PERIOD, samples)

    def sample(state, number):
        plant = PlantState(Quaternion(moving.quaternion[number]), moving.omega[number])
        estimate, state = navigation.step(number, jnp.array(PERIOD), plant, state)
        return state, estimate

    moving = jax.tree.map(jnp.asarray, moving)
    first = navigation.init(PlantState(Quaternion(moving.quaternion[0]), moving.omega[0]))
    run = eqx.filter_jit(lambda first: jax.lax.scan(sample, first, jnp.arange(samples))[1])
    return moving, run(first)


@pytest.mark.parametrize(
    ("every", "latency"),
    [(1, 2), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((5, 0), (2, 7)))],
)
def test_an_attitude_arrives_when_it_should_and_is_that_of_its_time(every, latency):
    moving, estimate = raw(40, every, latency)
    np.testing.assert_array_equal(estimate.omega, moving.omega)
    for number in range(latency, 40):
        origin = (number - latency) // every * every
        off = attitude_errors(moving.quaternion[origin], np.asarray(estimate.attitude.q[number]))
        assert np.linalg.norm(off) < 1e-8
    first = attitude_errors(moving.quaternion[0], np.asarray(estimate.attitude.q[0]))
    assert (np.linalg.norm(first) > 1e-3) == (latency > 0)  # that of the draw, until one arrives


def test_there_is_no_attitude_above_the_rate():
    sizes = np.linalg.norm(motion(PERIOD, 400).omega, axis=1)
    limit = np.median(sizes)
    moving, estimate = raw(400, 1, 0, limit)
    off = attitude_errors(np.asarray(moving.quaternion), np.asarray(estimate.attitude.q))
    seen = np.linalg.norm(off, axis=1) < 1e-8
    assert 0.3 < seen.mean() < 0.7
    np.testing.assert_array_equal(seen[1:], sizes[1:] <= limit)


def test_another_key_draws_other_errors_and_the_same_key_the_same():
    def first(key, attitude):
        navigation = Navigation(
            Gyro(1e-5, bias_sigma=1e-4), StarTracker(1e-4, 1e-4), RawMeasurements(), 0.01, key
        )
        return navigation.init(PlantState(attitude, jnp.zeros(3)))

    one, same, other = (first(key, STILL) for key in ((1, 2), (1, 2), (1, 3)))
    np.testing.assert_array_equal(one.bias, same.bias)
    assert np.all(one.bias != other.bias)
    assert np.all(one.memory.q != other.memory.q)
    in_wz = first((1, 2), WZ([0.0, 0.0], 0.0))
    np.testing.assert_allclose(in_wz.memory.q, one.memory.q, atol=1e-15)
