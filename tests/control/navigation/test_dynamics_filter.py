"""The filter by the dynamics against one in SciPy, χ² bands, closed forms and exact motions."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from control.navigation.dynamics import (
    AXES,
    INERTIA,
    PERIOD,
    RATE_SIGMA,
    TORQUES,
    flights,
    moved,
    navigation_of,
    watched,
)
from control.navigation.motion import ORBIT_RATE, attitude_errors, inertial, relative
from control.navigation.test_filter import covariance, tracker, within_band
from control.navigation.test_innovations import failures
from control.navigation.test_vectors import magnetometer, sun_sensor
from jaxsat.control.navigation.dynamics_filter import DynamicsFilter, TorqueModel
from jaxsat.control.navigation.estimator import Measurement
from jaxsat.control.navigation.innovation import InnovationTest
from jaxsat.control.navigation.motion import MotionBelief
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.sensor import SensorFailureKind
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.navigation_sensors import StarTracker
from jaxsat.spacecraft.spacecraft import Spacecraft
from oracle.dynamics_filter import DynamicsOracle


@pytest.mark.slow
@pytest.mark.parametrize("latency", [0, 3])
def test_the_filter_is_the_one_written_in_scipy(latency):
    """Estimates and covariances at every sample, with noisy tachometers."""
    seen_by, noise, count = tracker(every=4, latency=latency), 1e-3, 25
    (flight,) = zip(*flights(1, count, wheels=4), strict=True)
    _, quaternion, torque, _, momentum = flight
    rng = np.random.default_rng(3)
    momenta = momentum + noise * rng.normal(size=momentum.shape)
    times = PERIOD * np.arange(count)
    measured = Rotation.from_quat(np.roll(quaternion, -1, axis=1))
    measured = measured * Rotation.from_rotvec(2e-4 * rng.normal(size=(count, 3)))
    relatives = np.roll(measured.as_quat(), 1, axis=1)
    start = Quaternion(quaternion[0]).turned(jnp.array([0.01, -0.02, 0.005]))
    first = inertial(np.asarray(start.q), times[0])
    model = [float(one) for one in (TORQUES.noise, TORQUES.sigma, TORQUES.walk)]
    oracle = DynamicsOracle(
        *(PERIOD, INERTIA, model, noise**2 * AXES @ AXES.T, np.asarray(covariance(seen_by))),
        *(first, first.inv().apply([0.0, -ORBIT_RATE, 0.0]), (0.02, RATE_SIGMA)),
    )
    estimator = navigation_of(seen_by, wheels=4, noise=noise).estimator
    memory, step = estimator.init(start, jnp.array(0.02)), eqx.filter_jit(estimator.step)
    attitudes, stored = {}, momenta @ AXES.T
    for number in range(count):
        origin = number - latency
        seen = origin >= 0 and origin % 4 == 0
        if seen:
            attitudes[origin] = inertial(relatives[origin], times[origin])
        measurement = Measurement(
            *(None, Quaternion(relatives[max(origin, 0)]), jnp.array(seen), ()),
            *(jnp.array(torque[number]), jnp.array(stored[number])),
        )
        estimate, memory = step(jnp.array(number), jnp.array(PERIOD), measurement, memory)
        attitude, others, matrix = oracle.run(stored[: number + 1], torque, attitudes)
        believed = inertial(np.asarray(estimate.attitude.q), times[number])
        np.testing.assert_allclose((believed.inv() * attitude).as_rotvec(), 0, atol=1e-10)
        np.testing.assert_allclose(estimate.omega, others[:3], atol=1e-12)
        deviations = np.sqrt(np.diag(matrix))
        np.testing.assert_allclose(estimate.attitude_sigma, deviations[:3], rtol=1e-8)
        np.testing.assert_allclose(estimate.rate_sigma, deviations[3:6], rtol=1e-8)
        if not latency:
            np.testing.assert_allclose(memory.belief.torque, others[3:6], atol=1e-12)
            np.testing.assert_allclose(memory.belief.excess, others[6:], atol=1e-12)
            np.testing.assert_allclose(memory.belief.covariance, matrix, rtol=1e-7, atol=1e-16)


def normalised_squares(flown, belief, number, biases=None):
    """εᵀP⁻¹ε of attitude, rate, unknown torque and bias of every case at a sample (NEES)."""
    error = np.concatenate(
        [
            attitude_errors(flown.quaternion[:, number], np.asarray(belief.q[:, number])),
            flown.omega[:, number] - belief.omega[:, number],
            flown.unknown[:, number] - belief.torque[:, number],
        ],
        axis=1,
    )
    if biases is not None:
        error = np.concatenate([error, biases[:, number] - belief.bias[:, number]], axis=1)
    size = error.shape[1]
    matrix = np.asarray(belief.covariance[:, number, :size, :size])
    return np.einsum("ci,ci->c", error, np.linalg.solve(matrix, error[..., None])[..., 0])


SETS = {
    "star tracker": (tracker(every=2), (), 0, 0.0),
    "star tracker and late": (tracker(every=3, latency=2), (), 0, 0.0),
    "magnetometer and Sun sensor": (None, (magnetometer(), sun_sensor()), 0, 0.0),
    "star tracker and tachometers": (tracker(every=2), (), 4, 2e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_errors_are_as_large_as_the_filter_claims(name):
    """NEES of the nine states in its χ² band, from the first draw to the end."""
    seen_by, vectors, wheels, noise = SETS[name]
    flown = flights(200, 201, wheels)
    navigation = navigation_of(seen_by, vectors, wheels, noise)
    _, belief, _ = watched(navigation, flown, noise)
    latency = navigation.estimator.latency
    found = flown._replace(
        **{
            part: np.roll(getattr(flown, part), latency, axis=1)
            for part in ("quaternion", "omega", "unknown")
        }
    )
    for number in (latency, 3, 4, 10, 50, 100, 199, 200):
        squares = normalised_squares(found, belief, number)
        assert within_band(squares, 9), (number, squares.mean())


@pytest.mark.slow
def test_a_constant_torque_that_is_not_estimated_is_told_apart():
    """NEES of attitude and rate leaves its band; with the torque in the state it does not."""
    flown = flights(100, 101)
    blind = TorqueModel(float(TORQUES.noise))
    _, belief, _ = watched(navigation_of(tracker(every=2), torques=blind), flown)
    matrix = np.asarray(belief.covariance[:, 100, :6, :6])
    error = np.concatenate(
        [
            attitude_errors(flown.quaternion[:, 100], np.asarray(belief.q[:, 100])),
            flown.omega[:, 100] - belief.omega[:, 100],
        ],
        axis=1,
    )
    squares = np.einsum("ci,ci->c", error, np.linalg.solve(matrix, error[..., None])[..., 0])
    assert not within_band(squares, 6)


def unseen(estimator, memory, torques, momenta, period):
    """Attitude and rate after these inputs without a measurement of the attitude."""

    def sample(memory, now):
        number, torque, momentum = now
        still = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))
        measurement = Measurement(None, still, jnp.array(False), (), torque, momentum)
        estimate, memory = estimator.step(number, jnp.array(period), measurement, memory)
        return memory, (estimate.attitude.q, estimate.omega)

    inputs = (jnp.arange(len(torques)), jnp.array(torques), jnp.array(momenta))
    return jax.tree.map(np.asarray, jax.lax.scan(sample, memory, inputs)[1])


def prediction_errors(period):
    """Errors of attitude (rad) and rate (rad/s) after 20 s of a tumble with spinning wheels."""
    count = round(20 / period) + 1
    first, spin_up, axes = np.array([0.06, -0.05, 0.04]), np.array([[0.01, -0.02]]), AXES[:, :2]
    push, times = np.array([[0.03, 0.01, -0.02]]), np.arange(count) * period
    state = (first[None], np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([[0.4, 0.1]]))
    rows = [state]
    for _ in times[1:]:
        rows.append(moved(*rows[-1], push, spin_up, axes, period, round(100 * period)))
    omega, q, h = (np.concatenate(one) for one in zip(*rows, strict=True))
    true = relative(Rotation.from_quat(q / np.linalg.norm(q, axis=1)[:, None]), times)
    estimator = navigation_of(tracker(), wheels=2).estimator
    memory = estimator.init(Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0])), jnp.array(0.0))
    memory = memory._replace(belief=memory.belief._replace(omega=jnp.array(first)))
    torques = np.tile(push, (count, 1))
    found = unseen(estimator, memory, torques, h @ axes.T, period)
    return np.array([np.linalg.norm(attitude_errors(true[-1], found[0][-1])),
                     np.linalg.norm(omega[-1] - found[1][-1])])  # fmt: skip


def test_its_prediction_is_the_motion_of_the_gyrostat():
    """Against Runge-Kutta in NumPy: the error falls with the square of the period, from little."""
    coarse, fine = (prediction_errors(period) for period in (0.2, 0.1))
    assert np.all(coarse < [5e-5, 5e-6])
    assert np.all(coarse / fine > 3.5)


def test_its_covariance_moves_as_differences_of_the_motion():
    """Columns of the transition by central differences of Runge-Kutta's motion in one period."""
    start = (np.array([0.05, -0.03, 0.04]), np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.6, -0.2]))
    push, axes, length = np.array([0.03, 0.01, -0.02]), AXES[:, :2], 0.5
    spin_up = np.array([0.01, -0.02])

    def after(omega, torque):
        found = moved(*(one[None] for one in (omega, *start[1:])), torque[None], spin_up[None],
                      axes, length, 50)  # fmt: skip
        return found[0][0], Rotation.from_quat(found[1][0])

    omega, attitude = after(start[0], push)
    steps = np.eye(3) * 1e-5
    columns = []
    for change in (*((step, 0 * step) for step in steps), *((0 * step, step) for step in steps)):
        rate, turned = after(start[0] + change[0], push + change[1])
        off = (attitude.inv() * turned).as_rotvec()
        columns.append(np.concatenate([off, rate - omega]) / 1e-5)
    expected = np.array(columns).T  # of rate and torque
    estimator = navigation_of(tracker(), wheels=2, torques=TorqueModel(0.0)).estimator
    h = axes @ start[2]
    for number in range(6):
        covariance = jnp.zeros((9, 9)).at[3 + number, 3 + number].set(1.0)
        belief = MotionBelief(
            jnp.array([1.0, 0, 0, 0]), jnp.array(start[0]), jnp.zeros(3), covariance
        )
        inputs = (h, h + length * axes @ spin_up, push, length, 0.0)
        found = estimator.moved(belief, *map(jnp.asarray, inputs)).covariance[:6, :6]
        column = expected[:, number]
        atol = 5e-3 * np.abs(column).max() ** 2
        np.testing.assert_allclose(found, np.outer(column, column), atol=atol)


def test_steady_state_is_the_double_integrator_s():
    """One axis at rest, against the closed form of a white torque held in each period.

    Kalata, IEEE Trans. Aerospace and Electronic Systems 20(2), 1984; Bar-Shalom and others,
    Estimation with Applications to Tracking and Navigation, 2001, section 6.5.
    """
    period, deviation, noise, moments = 0.5, 5e-5, 1e-4, np.array([5.0, 20.0, 80.0])
    still = RigidBody(Spacecraft(moments), ExactOrbit(0.0))
    seen_by = StarTracker(deviation, deviation)
    estimator = DynamicsFilter(still, TorqueModel(noise), 1e-3, seen_by)
    upright, zero = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0])), jnp.zeros(3)

    def sample(memory, number):
        measurement = Measurement(None, upright, jnp.array(True), (), zero)
        estimate, memory = estimator.step(number, jnp.array(period), measurement, memory)
        return memory, (estimate.attitude_sigma, estimate.rate_sigma)

    run = eqx.filter_jit(lambda start: jax.lax.scan(sample, start, jnp.arange(600))[1])
    found = run(estimator.init(upright, jnp.array(1e-3)))
    index = noise / np.sqrt(period) / moments * period**2 / deviation
    root = np.sqrt(index**2 + 8 * index)
    alpha = ((index + 4) * root - index**2 - 8 * index) / 8
    beta = (index**2 + 4 * index - index * root) / 4
    rate = np.sqrt(beta * (alpha - beta / 2) / (1 - alpha)) / period
    np.testing.assert_allclose(found[0][-1], deviation * np.sqrt(alpha), rtol=1e-6)
    np.testing.assert_allclose(found[1][-1], deviation * rate, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [SensorFailureKind.STUCK, SensorFailureKind.DRIFTING])
def test_a_tracker_that_fails_is_excluded_and_the_rest_stays_honest(kind):
    """NEES with a magnetometer and a Sun sensor, before the failure at 25 s and after."""
    flown = flights(150, 201)
    wrong = failures(kind, 25.0, drift=(2e-3, 0.0, 1e-3))
    navigation = navigation_of(
        tracker(every=2), (magnetometer(), sun_sensor()), test=InnovationTest(1e-6), failures=wrong
    )
    estimates, belief, _ = watched(navigation, flown)
    excluded = np.asarray(estimates.excluded)
    assert not excluded[:, :50].any()
    assert excluded[:, 70:, 0].all()
    assert not excluded[..., 1:].any()
    for number in (40, 100, 200):
        squares = normalised_squares(flown, belief, number)
        assert within_band(squares, 9), (number, squares.mean())
