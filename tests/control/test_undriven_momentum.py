"""The attitudes that two wheels with momentum hold, and how momentum is learnt, against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from jaxsat.control.momentum_fit import SAMPLES, MomentumFit
from jaxsat.control.two_wheels import nearest_held, relative_to
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.spacecraft import Spacecraft

ZERO = jnp.array(0.0)
INERTIA = np.array([[420.0, 30.0, -20.0], [30.0, 380.0, 25.0], [-20.0, 25.0, 250.0]])
ERROR = np.array([[25.0, -4.0, 3.0], [-4.0, -30.0, 2.0], [3.0, 2.0, 12.0]])


def least_turn(momentum, coasting, normal):
    """By SciPy, from several rotation vectors (rad)."""

    def missing(turn):  # n·C H - n·β; Rotation turns the body, C its components
        return Rotation.from_rotvec(turn).inv().apply(momentum) @ normal - coasting @ normal

    found = [
        minimize(
            lambda turn: turn @ turn,
            start,
            constraints={"type": "eq", "fun": missing},
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 300},
        )
        for start in 0.5 * np.vstack([np.eye(3), -np.eye(3)])
    ]
    return min(np.linalg.norm(one.x) for one in found if one.success)


@pytest.mark.parametrize("seed", range(6))
def test_the_nearest_attitude_is_held_and_is_the_nearest(seed):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    momentum, coasting = rng.normal(size=3), (seed % 3) * 0.2 * rng.normal(size=3)
    held = nearest_held(*map(jnp.asarray, (momentum, coasting, normal)), ZERO)
    assert held.exists
    left = normal @ (np.asarray(held.attitude.as_dcm().matrix) @ momentum - coasting)
    assert abs(left) < 1e-12
    assert float(held.angle) == pytest.approx(least_turn(momentum, coasting, normal), abs=1e-6)


def test_momentum_along_the_normal_takes_a_quarter_turn_and_too_much_coasting_none():
    normal = jnp.array([0.0, 0.6, 0.8])
    held = nearest_held(2e-3 * normal, jnp.zeros(3), normal, ZERO)
    assert float(held.angle) == pytest.approx(np.pi / 2)
    assert not nearest_held(2e-3 * normal, 3e-3 * normal, normal, ZERO).exists


def test_momentum_that_is_hardly_known_leaves_the_target():
    normal, momentum = jnp.array([0.0, 0.0, 1.0]), jnp.array([1e-5, 0.0, 1e-5])
    assert float(nearest_held(momentum, jnp.zeros(3), normal, jnp.array(1e-3)).angle) < 1e-6
    assert float(nearest_held(momentum, jnp.zeros(3), normal, ZERO).angle) == pytest.approx(
        np.pi / 4
    )


def test_an_attitude_relative_to_another_is_the_product_of_matrices():
    one, other = (
        Quaternion(jnp.asarray(q / np.linalg.norm(q)))
        for q in np.random.default_rng(3).normal(size=(2, 4))
    )
    product = relative_to(one, other).as_dcm().matrix @ other.as_dcm().matrix
    np.testing.assert_allclose(product, one.as_dcm().matrix, atol=1e-14)


def test_momentum_and_inertia_are_learnt_from_a_motion_by_scipy():
    """A body with wheels that nothing from outside turns; the fit believes another inertia."""
    true = INERTIA + ERROR

    def torque(t):
        return 0.3 * np.array([np.cos(0.05 * t), np.sin(0.08 * t), np.cos(0.11 * t)])

    def slope(t, y):
        h, omega = y[4:7], y[7:]
        change = np.linalg.solve(true, torque(t) - np.cross(omega, true @ omega + h))
        turn = np.asarray(Quaternion(y[:4]).rate(jnp.asarray(omega)).q)
        return np.concatenate([turn, -torque(t), change])

    start = np.concatenate([[0.8, 0.0, 0.6, 0.0], [0.4, -0.2, 0.3], [2e-3, -1e-3, 3e-3]])
    times = np.arange(0.0, 100.0, 1.0)
    motion = solve_ivp(slope, (0, 100), start, t_eval=times, rtol=1e-9, atol=1e-12).y.T
    fit = MomentumFit(Spacecraft(INERTIA), 0.1, 1e-7, 1e-12)
    update = jax.jit(lambda *told: fit.update(*told, again=jnp.array(False)))
    memory = fit.init()
    totals = []
    for row in motion:
        into_body = Quaternion(row[:4]).as_dcm().matrix
        total = into_body.T @ (INERTIA @ row[7:] + row[4:7])
        totals.append(np.asarray(into_body).T @ (true @ row[7:] + row[4:7]))
        memory = memory._replace(samples=jnp.array(SAMPLES))  # that each is an update
        memory = update(memory, into_body, jnp.asarray(row[7:]), total)
    momentum = totals[-1]
    np.testing.assert_allclose(totals[0], momentum, atol=1e-7)
    learnt, deviation = fit.known(memory)
    np.testing.assert_allclose(learnt, momentum, atol=1e-4 * np.abs(momentum).max())
    assert float(deviation) < 1e-4 * np.abs(momentum).max()
    np.testing.assert_allclose(fit.inertia(memory), true, atol=0.02)
