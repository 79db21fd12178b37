"""The law of two wheels: what torques it needs, what its reference does, and whether it settles."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.two_wheels import NO_TURN, TwoWheels, reference
from jaxsat.core.attitude import WZ, Quaternion
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft

INERTIA = np.array([[420.0, 30.0, -20.0], [30.0, 380.0, 25.0], [-20.0, 25.0, 250.0]])
OMEGA = 0.05


def law():
    return TwoWheels(RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0)))


def told(made, state, normal, max_rate):
    inertia, held = jnp.asarray(INERTIA), Quaternion(jnp.eye(4)[0])
    return made(state, jnp.asarray(normal), inertia, jnp.array(OMEGA), jnp.array(max_rate), held)


def normals(count):
    found = np.random.default_rng(4).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def test_the_torque_is_one_that_both_wheels_make_whatever_body_and_axes():
    made = jax.jit(lambda *told: law().torque(*told))
    rng = np.random.default_rng(5)
    for normal in normals(10):
        frame = np.asarray(law().frame(jnp.asarray(normal), jnp.asarray(INERTIA)))
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
        q = rng.normal(size=4)
        omega = frame[:2].T @ (1e-3 * rng.normal(size=2))  # n·Jω = 0
        state = PlantState(Quaternion(q / np.linalg.norm(q)), omega)
        torque = np.asarray(told(made, state, normal, 0.006))
        assert np.abs(torque).max() > 1e-4
        assert abs(normal @ torque) < 1e-12 * np.abs(torque).max() + 1e-15


@pytest.mark.parametrize(
    "start", [(0.5, 0.3, 2.0), (-0.2, 0.1, -0.4), (0.0, 0.0, 1.0), (1.2, -0.8, 0.1)]
)
def test_rates_that_follow_the_reference_bring_tilt_and_turn_to_zero(start):
    """Kinematics alone, without a third rate, by the classical Runge-Kutta rule."""

    def rate(q):
        attitude = Quaternion(q)
        wanted = OMEGA * reference(attitude, jnp.array(0.0))
        return attitude.rate(jnp.append(wanted, 0.0)).q

    def step(q, _):
        h = 1.0
        k1 = rate(q)
        k2 = rate(q + h / 2 * k1)
        k3 = rate(q + h / 2 * k2)
        k4 = rate(q + h * k3)
        q = q + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        q = q / jnp.linalg.norm(q)
        wz = Quaternion(q).as_wz()
        return q, jnp.append(jnp.abs(wz.w), jnp.abs(wz.z))

    q = WZ(np.array(start[:2]), start[2]).as_quaternion().q
    history = np.asarray(jax.lax.scan(step, q, None, 1500)[1])
    assert history[-1, :2].max() < 1e-3
    assert history[-1, 2] < NO_TURN
    assert history[:, :2].max() < max(2.0, 2 * max(map(abs, start[:2])))


def test_the_reference_turns_the_way_that_takes_the_turn_out():
    for w, z in (((0.2, 0.1), 0.5), ((-0.1, 0.3), -0.7)):
        attitude = WZ(np.array(w), z)
        wanted = reference(attitude.as_quaternion(), jnp.array(0.0))
        turn = attitude.rate(jnp.append(wanted, 0.0)).z
        assert float(turn) * z < 0


def test_the_feed_forward_is_the_derivative_of_the_reference():
    made, normal = law(), normals(1)[0]
    frame = np.asarray(made.frame(jnp.asarray(normal), jnp.asarray(INERTIA)))
    attitude = WZ(np.array([0.3, -0.2]), 0.8).as_quaternion()
    rates = np.array([2e-3, -1e-3])
    # in body axes the same rotation has its vector turned by the frame
    q = np.asarray(attitude.q)
    state = PlantState(Quaternion(np.append(q[0], frame.T @ q[1:])), frame[:2].T @ rates)
    torque = np.asarray(told(made.torque, state, normal, 1.0))
    step, zero = 1e-4, jnp.array(0.0)
    slope = np.asarray(attitude.rate(jnp.append(rates, 0.0)).q)
    ends = [np.asarray(reference(Quaternion(q + sign * step * slope), zero)) for sign in (1, -1)]
    change = OMEGA * (ends[0] - ends[1]) / (2 * step)
    pull = 3 * OMEGA * (rates - OMEGA * np.asarray(reference(attitude, zero)))
    np.testing.assert_allclose(torque, INERTIA @ (frame[:2].T @ (change - pull)), rtol=1e-6)
