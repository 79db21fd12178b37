"""The Riccati recursion and the eliminated limits against dense systems solved by NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.planning.spacecraft import planner
from jaxsat.control.planning.barriers import TorqueCost
from jaxsat.control.planning.riccati import (
    ARRIVAL_WEIGHT,
    DURATION_PROXIMITY,
    QuadraticTerms,
    newton_step,
    solved,
)
from jaxsat.control.planning.transcription import PlanObjective, Transcription, Unknowns

RANDOM = np.random.default_rng(11)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_small_systems(size):
    root = RANDOM.normal(size=(size, size))
    matrix, right = root @ root.T + np.eye(size), RANDOM.normal(size=(size, 4))
    found = solved(jnp.asarray(matrix), jnp.asarray(right))
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-10)


def test_elimination_of_sizes():
    """Newton's step of u and t of min length t with barriers, both of them unknown."""
    mu, length = jnp.array(0.03), jnp.array(0.2)
    cost = TorqueCost.of_sizes(jnp.array([0.3, -0.6]), jnp.array(0.05), length)
    curvature, gradient = cost.terms(mu, length)
    du = -gradient / curvature
    found = cost.change(du, mu, length)
    by_u, by_t = np.array([1, -1, -1, 1.0]), np.array([0, 0, 1, 1.0])
    for k in range(2):
        s = np.array([one.slack[k] for one in cost.limits])
        z = np.array([one.multiplier[k] for one in cost.limits])
        rows = np.stack([by_u, by_t])
        hessian = (rows * (z / s)) @ rows.T
        slope = np.array([0.0, float(length)]) - rows @ (float(mu) / s)
        step = np.linalg.solve(hessian, -slope)
        ds = step @ rows
        dz = float(mu) / s - z - z / s * ds
        np.testing.assert_allclose(du[k], step[0], rtol=1e-10)
        np.testing.assert_allclose([one.slack[k] for one in found.limits], ds, rtol=1e-9)
        np.testing.assert_allclose([one.multiplier[k] for one in found.limits], dz, rtol=1e-9)


@pytest.mark.slow
def test_step_solves_the_dense_system():
    """The same step by the KKT matrix of all unknowns, its blocks by central differences."""
    made, n, m = planner(orbit_rate=0.01), 4, 2
    program = Transcription(made.model, made.torque_axes, made.limit, PlanObjective.TIME, n, 1)
    begin = jnp.array(0.3)
    x = RANDOM.normal(size=(n + 1, 7)) * 0.3 + np.eye(7)[0]
    u, duration = RANDOM.uniform(-0.5, 0.5, (n, m)), 2.3
    nu = RANDOM.normal(size=6)
    curvature, gradient = RANDOM.uniform(0.5, 2.0, (n, m)), RANDOM.normal(size=(n, m))
    terms = QuadraticTerms(
        jnp.asarray(curvature),
        jnp.asarray(gradient),
        jnp.array(0.7),
        jnp.array(0.9),
        jnp.array(0.1),
    )
    at = Unknowns(jnp.asarray(x[:-1]), jnp.asarray(x[-1]), jnp.asarray(u), jnp.array(duration))
    step = jax.jit(lambda: newton_step(program, begin, at, jnp.asarray(nu), terms))()

    size = 7 * n + m * n + 1  # x1 ... xn, u, T
    order = jnp.arange(n, dtype=float)
    intervals = jax.jit(
        lambda x, duration, u: jax.vmap(program.interval, (None, 0, 0, None, 0))(
            begin, order, x, duration, u
        )
    )

    def tied(v):
        states = np.concatenate([x[:1], v[: 7 * n].reshape(n, 7)])
        torque = v[7 * n : -1].reshape(n, m)
        return (np.asarray(intervals(states[:-1], v[-1], torque)) - states[1:]).ravel()

    def arrival(v):
        return np.asarray(program.arrival(jnp.asarray(v[7 * (n - 1) : 7 * n])))

    v = np.concatenate([x[1:].ravel(), u.ravel(), [duration]])
    ties, missed = _jacobian(tied, v), _jacobian(arrival, v)
    weights = np.concatenate(
        [np.zeros(7 * n), curvature.ravel() + 0.1, [0.7 + DURATION_PROXIMITY * 0.1]]
    )
    hessian = np.diag(weights) + ARRIVAL_WEIGHT * missed.T @ missed
    slope = np.concatenate([np.zeros(7 * n), gradient.ravel(), [0.9]])
    slope = slope + missed.T @ (nu + ARRIVAL_WEIGHT * arrival(v))
    kkt = np.block([[hessian, ties.T], [ties, np.zeros((7 * n, 7 * n))]])
    found = np.linalg.solve(kkt, -np.concatenate([slope, tied(v)]))
    own = np.concatenate([step.change.states[1:], step.change.last[None]]).ravel()
    np.testing.assert_allclose(own, found[: 7 * n], atol=2e-5)
    np.testing.assert_allclose(step.change.torque.ravel(), found[7 * n : size - 1], atol=2e-5)
    np.testing.assert_allclose(step.change.duration, found[size - 1], atol=2e-5)
    multipliers = nu + ARRIVAL_WEIGHT * (arrival(v) + missed @ found[:size])
    largest = max(np.abs(found[size:]).max(), np.abs(multipliers).max())
    np.testing.assert_allclose(step.largest_multiplier, largest, rtol=2e-3)


def _jacobian(function, v, step=1e-6):
    columns = [
        (function(v + step * unit) - function(v - step * unit)) / (2 * step)
        for unit in np.eye(len(v))
    ]
    return np.stack(columns, axis=1)
