"""The filter against one in SciPy, chi-squared bands and Farrenkopf's steady state."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from control.navigation.motion import ORBIT_RATE, attitude_errors, inertial, motion
from jaxsat.control.navigation.estimator import Measurement
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.orbit import ExactOrbit, SmallAngleOrbit
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from oracle.attitude_filter import Oracle

PERIOD = 0.1
DENSITY, WALK, BIAS = 1.5e-5, 3e-7, 1e-4
GYRO = Gyro(DENSITY, WALK, bias_sigma=BIAS)


def tracker(every=5, latency=0, **others):
    return StarTracker(4e-5, 2e-4, [0.6, 0.0, 0.8], every, latency, **others)


def covariance(tracker):
    return tracker.axes.T @ jnp.diag(tracker.deviations**2) @ tracker.axes


@eqx.filter_jit
def _flown(navigation, keys, omega, quaternion):
    def one(key):
        own = eqx.tree_at(lambda navigation: navigation.key, navigation, key)

        def sample(state, number):
            plant = PlantState(Quaternion(quaternion[number]), omega[number])
            estimate, after = own.step(number, jnp.array(PERIOD), plant, state)
            return after, (estimate, after.memory.belief, state.bias)

        first = own.init(PlantState(Quaternion(quaternion[0]), omega[0]))
        return jax.lax.scan(sample, first, jnp.arange(len(omega)))[1]

    return jax.vmap(one)(keys)


def flown(cases, tracker, gyro=GYRO, believed=GYRO):
    """The motion, and estimates, beliefs and true biases of several runs of it."""
    moving = motion(PERIOD, 601)
    estimator = MultiplicativeFilter(ExactOrbit(ORBIT_RATE), believed, tracker)
    navigation = Navigation(gyro, tracker, estimator, 0.01)
    keys = jnp.stack([jnp.arange(cases, dtype=jnp.uint32), jnp.full(cases, 7, jnp.uint32)], 1)
    return moving, *_flown(navigation, keys, moving.omega, moving.quaternion)


@pytest.mark.parametrize("latency", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_the_filter_is_the_one_written_in_scipy(latency):
    """Estimates and covariances at every sample, the late attitudes put where they belong."""
    seen_by = tracker(latency=latency)
    moving = motion(PERIOD, 31)
    generator = np.random.default_rng(3)
    rates = moving.omega + 1e-3 + 1e-4 * generator.normal(size=moving.omega.shape)
    times = PERIOD * np.arange(31)
    measured = Rotation.from_quat(np.roll(moving.quaternion, -1, axis=1))
    measured = measured * Rotation.from_rotvec(2e-4 * generator.normal(size=(31, 3)))
    relative = np.roll(measured.as_quat(), 1, axis=1)
    start = Quaternion(moving.quaternion[0]).turned(jnp.array([0.01, -0.02, 0.005]))
    oracle = Oracle(
        *(PERIOD, (DENSITY, WALK), np.asarray(covariance(seen_by))),
        *(inertial(np.asarray(start.q), times[0]), 0.02, BIAS),
    )
    estimator = MultiplicativeFilter(ExactOrbit(ORBIT_RATE), GYRO, seen_by)
    memory, step = estimator.init(start, jnp.array(0.02)), eqx.filter_jit(estimator.step)
    attitudes = {}
    for number in range(31):
        origin = number - latency
        seen = origin >= 0 and origin % 5 == 0
        if seen:
            attitudes[origin] = inertial(relative[origin], times[origin])
        measurement = Measurement(
            jnp.array(rates[number]), Quaternion(relative[max(origin, 0)]), jnp.array(seen)
        )
        estimate, memory = step(jnp.array(number), jnp.array(PERIOD), measurement, memory)
        attitude, bias, matrix = oracle.run(rates[: number + 1], attitudes)
        believed = inertial(np.asarray(estimate.attitude.q), times[number])
        np.testing.assert_allclose((believed.inv() * attitude).as_rotvec(), 0, atol=1e-12)
        np.testing.assert_allclose(estimate.bias, bias, atol=1e-12)
        deviations = np.sqrt(np.diag(matrix))
        np.testing.assert_allclose(estimate.attitude_sigma, deviations[:3], rtol=1e-8)
        np.testing.assert_allclose(estimate.bias_sigma, deviations[3:6], rtol=1e-8)
        rate = np.sqrt(np.diag(matrix[3:6, 3:6] + matrix[6:, 6:] + 2 * matrix[3:6, 6:]))
        np.testing.assert_allclose(estimate.rate_sigma, rate, rtol=1e-8)


def within_band(squares, degrees):
    """Whether a sum of squares over cases and axes lies where 1 - 1e-4 of all sums lie."""
    low, high = chi2.ppf([0.5e-4, 1 - 0.5e-4], degrees * len(squares))
    return low < np.sum(squares) < high


def normalised_squares(moving, belief, biases, number):
    """εᵀP⁻¹ε of all six states of every case at a sample (NEES)."""
    error = np.concatenate(
        [
            attitude_errors(moving.quaternion[number], belief.q[:, number]),
            np.asarray(biases[:, number] - belief.b[:, number]),
        ],
        axis=1,
    )
    blocks = [[belief.attitude, belief.cross], [np.swapaxes(belief.cross, 2, 3), belief.bias]]
    matrix = np.block([[np.asarray(part[:, number]) for part in row] for row in blocks])
    return np.einsum("ci,ci->c", error, np.linalg.solve(matrix, error[..., None])[..., 0])


@pytest.mark.slow
@pytest.mark.parametrize("cases", [1000])
def test_errors_are_as_large_as_the_filter_claims(cases):
    """NEES of the six states in its χ² band, from the first draw to the steady state."""
    moving, _, belief, biases = flown(cases, tracker())
    for number in (0, 4, 5, 20, 150, 299, 300, 599, 600):
        squares = normalised_squares(moving, belief, biases, number)
        assert within_band(squares, 6), (number, squares.mean())


@pytest.mark.slow
def test_a_filter_that_knows_too_much_is_told_apart():
    """The same test fails for a gyro that is three times as noisy as declared."""
    worse = Gyro(3 * DENSITY, WALK, bias_sigma=BIAS)
    moving, _, belief, biases = flown(100, tracker(), gyro=worse)
    assert not within_band(normalised_squares(moving, belief, biases, 600), 6)


def farrenkopf(density, walk, deviation, interval):
    """Steady deviations of attitude and bias just before and just after an attitude.

    Farrenkopf, J. Guidance and Control 1(4), 1978, in the form of Markley and Crassidis,
    Fundamentals of Spacecraft Attitude Determination and Control, 2014, section 6.5, without
    readout noise: attitudes with the deviation (rad) arrive every `interval` s.
    """
    white = density * np.sqrt(interval) / deviation
    drift = walk * interval**1.5 / deviation
    gamma = np.sqrt(1 + white**2 / 4 + drift**2 / 48)
    zeta = gamma + drift / 4 + np.sqrt(2 * gamma * drift + white**2 + drift**2 / 3) / 2
    attitude = deviation * np.sqrt([zeta**2 - 1, 1 - 1 / zeta**2])
    root = np.sqrt(drift) * np.sqrt(zeta - drift / 2 - 1 / zeta + np.array([drift, 0]))
    return attitude, deviation / interval * root


def riccati(density, walk, deviation, interval):
    """The same by SciPy's discrete Riccati equation."""
    transition = np.array([[1, -interval], [0, 1]])
    white, drift = density**2, walk**2
    noise = np.array(
        [
            [white * interval + drift * interval**3 / 3, -drift * interval**2 / 2],
            [-drift * interval**2 / 2, drift * interval],
        ]
    )
    observed, variance = np.array([[1.0], [0.0]]), np.array([[deviation**2]])
    before = solve_discrete_are(transition.T, observed, noise, variance)
    gain = before @ observed / (before[0, 0] + variance)
    after = before - gain @ observed.T @ before
    return np.sqrt(np.stack([np.diag(before), np.diag(after)], axis=1))


GOOD, POOR = (1.5e-6, 3e-8), (1e-4, 1e-5)


@pytest.mark.parametrize("gyro", [GOOD, POOR], ids=["good", "poor"])
def test_steady_state_is_farrenkopf_s(gyro):
    """Single axis, attitudes once a second and rates a hundred times as often.

    The closed form has rates without an end of their own at each attitude; half a sample's noise
    is left out of it, a part in a hundred.
    """
    deviation, every, period = 5e-5, 100, 0.01
    attitude, bias = farrenkopf(*gyro, deviation, every * period)
    exact = riccati(*gyro, deviation, every * period)
    np.testing.assert_allclose(attitude, exact[0], rtol=1e-6)
    np.testing.assert_allclose(bias, exact[1], rtol=1e-6)
    believed = Gyro(*gyro, bias_sigma=bias[0])
    seen_by = StarTracker(deviation, deviation, every=every)
    estimator = MultiplicativeFilter(ExactOrbit(0.0), believed, seen_by)
    still = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))

    def sample(memory, number):
        measurement = Measurement(jnp.zeros(3), still, number % every == 0)
        estimate, memory = estimator.step(number, jnp.array(period), measurement, memory)
        return memory, (estimate.attitude_sigma, estimate.bias_sigma)

    count = 200 * every + 1
    run = eqx.filter_jit(lambda start: jax.lax.scan(sample, start, jnp.arange(count))[1])
    found = run(estimator.init(still, jnp.array(attitude[0])))
    for sigma, expected in zip(found, (attitude, bias), strict=True):
        np.testing.assert_allclose(sigma[-1], expected[1], rtol=1e-2)
        np.testing.assert_allclose(sigma[-2], expected[0], rtol=1e-2)


def test_it_knows_the_orbit_that_the_paper_simulates_with():
    """Under (0, -ω0, 0) in body axes whatever the attitude: turning at that rate is rest."""
    orbit = SmallAngleOrbit(ORBIT_RATE)
    estimator = MultiplicativeFilter(orbit, GYRO, tracker())
    start = Quaternion(jnp.array([0.5, 0.5, -0.5, 0.5]))
    memory, unseen = estimator.init(start, jnp.array(0.0)), jnp.array(False)
    for number in range(20):
        measurement = Measurement(jnp.array([0.0, -ORBIT_RATE, 0.0]), start, unseen)
        arguments = (jnp.array(number), jnp.array(PERIOD), measurement, memory)
        estimate, memory = eqx.filter_jit(estimator.step)(*arguments)
    np.testing.assert_allclose(estimate.attitude.q, start.q, atol=1e-14)


@pytest.mark.slow
def test_a_rate_at_the_gyro_s_limit_counts_as_unknown():
    """The attitude is lost with the rate, is said to be lost, and comes back with the tracker."""
    gyro = Gyro(DENSITY, WALK, bias_sigma=BIAS, limit=0.014)
    blind = tracker(rate_limit=0.018)
    moving, estimate, _, _ = flown(100, blind, gyro=gyro, believed=gyro)
    seen = np.linalg.norm(moving.omega, axis=1) < 0.018
    assert not seen[:550].any()
    assert seen[580:].all()
    assert np.abs(moving.omega[580:]).max() < 0.0139
    for case in range(100):
        errors = np.abs(attitude_errors(moving.quaternion, estimate.attitude.q[case]))
        assert errors[550].max() > 0.05
        assert np.all(estimate.attitude_sigma[case, 550] > 0.015)
        assert np.all(errors[585:] < 5 * estimate.attitude_sigma[case, 585:])
        assert errors[600].max() < 1e-3


@pytest.mark.parametrize("angle", [0.5, 1.5, 3.0])
def test_an_attitude_that_was_lost_is_found_at_once(angle):
    """What is left of any turn is as small as the tracker's noise allows, and is claimed so."""
    estimator = MultiplicativeFilter(ExactOrbit(ORBIT_RATE), GYRO, tracker())
    believed = Rotation.from_rotvec([0.3, -0.5, 0.8])
    true = believed * Rotation.from_rotvec(angle * np.array([2.0, -1.0, 2.0]) / 3)
    start, seen = (Quaternion(np.roll(one.as_quat(), 1)) for one in (believed, true))
    memory = estimator.init(start, jnp.array(1.0))
    measurement = Measurement(jnp.zeros(3), seen, jnp.array(True))
    step = eqx.filter_jit(estimator.step)
    estimate, _ = step(jnp.array(0), jnp.array(PERIOD), measurement, memory)
    off = attitude_errors(np.asarray(seen.q), np.asarray(estimate.attitude.q))
    assert np.linalg.norm(off) < 1e-5
    assert np.all(estimate.attitude_sigma < 2e-4)
