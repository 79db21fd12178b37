"""The orbital regulator: linear model, rank, gain and poles, against hand algebra and SciPy."""

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_are

from control.cases import INERTIA, ORBIT_RATE, actuators, body, form
from jaxsat.attitude import Quaternion
from jaxsat.control import OrbitalRegulator, linear_model, reachable_rank, regulator_gain
from jaxsat.control.terminal import STATE_SCALE, TORQUE_SCALE
from jaxsat.control.tilt import tilt_of
from jaxsat.dynamics import PlantState
from jaxsat.environment import GravityGradient


def test_linear_model_by_hand():
    """With C ≈ I - skew(φ, θ, z) the frame turns at (-ω0 z, -ω0, ω0 φ) in body axes."""
    j1, j2, j3 = INERTIA
    w = ORBIT_RATE
    expected = np.zeros((6, 6))
    expected[0, [2, 3]] = w, 1
    expected[1, 4] = 1
    expected[2, [0, 5]] = -w, 1
    expected[3, 5] = -(j2 - j3) * w / j1
    expected[5, 3] = -(j1 - j2) * w / j3
    a, b = linear_model(form())
    np.testing.assert_allclose(a, expected, atol=1e-16)
    np.testing.assert_allclose(b, np.eye(6)[:, 3:5] / INERTIA[:2], atol=1e-16)


def test_linear_model_with_gravity_gradient():
    """Its stiffness about the first axis is 3 ω0² (J3 - J2), that about the second (J3 - J1)."""
    a, _ = linear_model(form(disturbance=GravityGradient(ORBIT_RATE)))
    j1, j2, j3 = INERTIA
    pull = 3 * ORBIT_RATE**2
    np.testing.assert_allclose(a[3, 0], pull * (j3 - j2) / j1, rtol=1e-9)
    np.testing.assert_allclose(a[4, 1], pull * (j3 - j1) / j2, rtol=1e-9)


@pytest.mark.parametrize(
    ("inertia", "orbit_rate", "rank"),
    [(INERTIA, ORBIT_RATE, 6), ([300.0, 300.0, 312.5], ORBIT_RATE, 5), (INERTIA, 0.0, 4)],
)
def test_rank(inertia, orbit_rate, rank):
    """The orbit and unlike moments are what makes the third axis reachable."""
    a, b = linear_model(form(inertia, orbit_rate))
    found, shortest = reachable_rank(a / np.linalg.norm(a, 2), b / np.linalg.norm(b, 2), 1e-9)
    assert found == rank
    assert 1e-9 < shortest <= 1 + 1e-12
    # Time counted in orbits: the same rank from the textbook matrix, whose columns are now alike.
    scaling = np.diag([1, 1, 1, 1e3, 1e3, 1e3])
    a, b = scaling @ a @ np.linalg.inv(scaling) * 1e3, scaling @ b
    columns = [b]
    for _ in range(5):
        columns.append(a @ columns[-1])
    unit = np.hstack([x / np.linalg.norm(x) if x.any() else x for x in columns])
    assert np.linalg.matrix_rank(unit, tol=1e-10) == rank


def test_gain_and_poles():
    """Against SciPy's Riccati solver, and the figures found by an independent program."""
    a, b = linear_model(form())
    gain = np.asarray(OrbitalRegulator.design(form()).gain)
    q, r = np.diag(np.array(STATE_SCALE) ** -2.0), np.eye(2) / TORQUE_SCALE**2
    exact = np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))
    np.testing.assert_allclose(gain, exact, rtol=1e-8, atol=1e-8)
    first, second = [0.429, 0, -5.081, 35.34, 0, -1305], [0, 1, 0, 0, 25.08, 0]
    np.testing.assert_allclose(gain, [first, second], rtol=5e-4, atol=1e-10)
    poles = np.sort_complex(np.linalg.eigvals(a - b @ gain))
    expected = [-0.0474 - 0.0392j, -0.0474 + 0.0392j, -0.0348 - 0.0317j, -0.0348 + 0.0317j]
    np.testing.assert_allclose(poles, [*expected, -0.00885, -8.15e-5], atol=1e-4)


def test_riccati_of_a_double_integrator():
    """Exact: q = r = 1 gives the gain (1, √3)."""
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    gain = regulator_gain(a, b, np.eye(2), np.eye(1))
    np.testing.assert_allclose(gain, [[1, np.sqrt(3)]], rtol=1e-12)


def test_uncontrollable_is_refused():
    with pytest.raises(ValueError, match="rank is 5 of 6"):
        OrbitalRegulator.design(form([300.0, 300.0, 312.5]))


@pytest.mark.slow
def test_regulator_on_the_free_body_follows_the_linear_solution():
    """A small start under the torque in continuous time, against the matrix exponential."""
    model = body()
    regulator = OrbitalRegulator.design(form())
    a, b = linear_model(form())
    x0 = 1e-2 * np.array([1e-4, -2e-4, 1.5e-4, 1e-6, -2e-6, 1e-7])
    vector = x0[:3] / 2
    omega = x0[3:] + np.array([0, -ORBIT_RATE, 0])
    start = PlantState(Quaternion([np.sqrt(1 - vector @ vector), *vector]), omega)

    def rate(t, state, args):
        tilt = tilt_of(state.attitude)
        excess = state.omega.at[1].add(ORBIT_RATE)
        torque = regulator.torque(tilt, tilt.turn, excess)
        return model.rate(t, state, actuators()(torque))

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), diffrax.Dopri8(), 0.0, 300.0, 0.5, start, max_steps=4000
    )
    end = solution.ys
    tilt = tilt_of(Quaternion(end.attitude.q[0]))
    omega = end.omega[0] - jnp.array([0, -ORBIT_RATE, 0])
    reached = np.array([tilt.phi, tilt.theta, tilt.turn, *omega])
    exact = expm((a - b @ np.asarray(regulator.gain)) * 300) @ x0
    np.testing.assert_allclose(reached[:3], exact[:3], atol=2e-10)
    np.testing.assert_allclose(reached[3:], exact[3:], atol=2e-12)
