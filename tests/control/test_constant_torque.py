"""A constant d3: where the orbital regulator holds it, from the plant's own equations."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import root

from control.cases import ORBIT_RATE, body, form
from jaxsat.attitude import Quaternion
from jaxsat.control import OrbitalRegulator, linear_model
from jaxsat.control.tilt import tilt_of
from jaxsat.dynamics import PlantState

INERTIA = np.array([449.5, 264.6, 312.5])
COUPLING = (INERTIA[0] - INERTIA[1]) / INERTIA[2]


def regulator():
    return OrbitalRegulator.design(form(), (0.1, 0.1, 0.05, 2e-3, 2e-3, 1e-3), 0.3)


def held_turn(d3):
    """ψ at which the orbital motion makes -d3 / J3: c ω1 ω2 with ω1 ≈ -ω0 ψ, ω2 ≈ -ω0."""
    return -d3 / (INERTIA[2] * COUPLING * ORBIT_RATE**2)


def equilibrium(d3, gain=1.0):
    """Rest in the orbit frame under d3, the regulator's gain scaled, by SciPy."""
    plant, law = body(), regulator()

    def residual(x):
        vector = x[:3] / 2
        q = np.concatenate([[np.sqrt(1 - vector @ vector)], vector])
        attitude = Quaternion(jnp.asarray(q))
        frame = np.asarray(plant.orbit.frame_rate(attitude))
        omega = jnp.asarray(frame + x[3:])
        tilt = tilt_of(attitude)
        excess = omega.at[1].add(ORBIT_RATE)
        command = gain * law.torque(tilt, tilt.turn, excess)
        torque = jnp.concatenate([command, jnp.array([d3])])
        rate = plant.rate(jnp.zeros(()), PlantState(attitude, omega), torque)
        return np.concatenate([np.asarray(rate.attitude.q[1:]) * 1e3, np.asarray(rate.omega) * 1e6])

    guess = np.array([-2 * held_turn(d3), 0.0, held_turn(d3), 0.0, 0.0, 0.0])
    found = root(residual, guess, tol=1e-12)
    assert np.abs(found.fun).max() < 1e-8
    return found.x


@pytest.mark.parametrize("d3", [1e-6, -3e-6])
@pytest.mark.parametrize("gain", [1.0, 2.0])
def test_constant_torque_is_held_by_a_turn(d3, gain):
    """-d3 / (J3 c ω0²) whatever the gain."""
    x = equilibrium(d3, gain)
    assert x[2] == pytest.approx(held_turn(d3), rel=0.02)
    np.testing.assert_allclose(x[3:], 0, atol=1e-9)


def test_tilt_bounds_what_can_be_held():
    """The tilt that comes with the turn is within 0.05 up to about 9e-6 N m."""
    (a, b), k = linear_model(form()), np.asarray(regulator().gain)
    x = np.linalg.solve(a - b @ k, -np.array([0, 0, 0, 0, 0, 1 / INERTIA[2]]))
    largest = 2 * 0.05 / np.hypot(x[0], x[1])
    assert x[2] == pytest.approx(held_turn(1.0), rel=1e-9)
    assert 8e-6 < largest < 1.1e-5
    tilt = equilibrium(0.5 * largest)
    assert np.hypot(tilt[0], tilt[1]) == pytest.approx(0.05, rel=0.1)
