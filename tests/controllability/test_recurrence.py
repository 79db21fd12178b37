"""Divergence, recurrence and the energy claim against SciPy and exact motions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.controllability.drift import (
    divergence,
    drift_trajectory,
    energy_bound,
    energy_counterexample,
    energy_history,
    recurrence,
)
from jaxsat.controllability.lie import DriftField, pack
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque

GENERAL = np.array([[9.0, 0.5, -0.3], [0.5, 5.0, 0.8], [-0.3, 0.8, 7.0]])
PAPER = np.diag([449.5, 264.6, 312.5])
AMPLITUDE = jnp.array([0.01, 0.02, 0.001])
FREQUENCY = jnp.array([0.7, 0.8, 0.1])


def random_state(seed, time=None):
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.linalg.det(q)
    return pack(jnp.asarray(q), jnp.asarray(rng.normal(size=3)), time)


@pytest.mark.slow
@pytest.mark.parametrize("disturbed", [False, True])
@pytest.mark.parametrize("orbit", ["exact", "small angle"])
def test_drift_has_no_divergence(disturbed, orbit):
    torque = PeriodicTorque(jnp.ones(3), FREQUENCY, jnp.zeros(3)).at if disturbed else None
    field = DriftField(jnp.asarray(GENERAL), disturbance=torque, orbit_rate=0.3, orbit=orbit)
    for seed in range(5):
        state = random_state(seed, 1.7 if disturbed else None)
        assert abs(float(divergence(field, state))) < 1e-12


@pytest.mark.slow
def test_divergence_sees_damping_and_attitude_feedback():
    """Fields whose divergence is known: −k ω has −3k; a(R) = R e_x-dependent turns by hand."""
    damped = lambda x: jnp.concatenate([jnp.zeros(9), -0.3 * x[9:12]])  # noqa: E731
    assert float(divergence(damped, random_state(0))) == pytest.approx(-0.9)

    def pointing(state):  # a = c × Rb for constant c, b: Σ ∂a_i over body turns = 2 c·Rb
        attitude = state[:9].reshape(3, 3)
        c, b = jnp.array([0.2, -0.5, 1.0]), jnp.array([0.6, 0.3, -0.2])
        a = jnp.cross(c, attitude @ b)
        turn = jnp.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        return jnp.concatenate([(-turn @ attitude).reshape(9), jnp.zeros(3)])

    state = random_state(3)
    attitude = np.asarray(state[:9]).reshape(3, 3)
    expected = 2 * np.array([0.2, -0.5, 1.0]) @ attitude @ np.array([0.6, 0.3, -0.2])
    assert abs(float(divergence(pointing, state))) == pytest.approx(abs(expected), rel=1e-12)


@pytest.mark.slow
def test_flow_keeps_volume():
    """Determinant of the flow map by finite differences of SciPy trajectories, in body turns."""
    from scipy.spatial.transform import Rotation

    e = np.array([0.0, -0.3, 0.0])

    def rate(t, x):
        r, w = x[:9].reshape(3, 3), x[9:]
        a = w - r @ e
        turn = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        torque = np.array([0.3, -0.2, 0.1]) * np.sin(np.array([0.7, 0.8, 0.1]) * t)
        return np.r_[
            (-turn @ r).ravel(), np.linalg.solve(GENERAL, torque - np.cross(w, GENERAL @ w))
        ]

    state = np.asarray(random_state(5))

    def end(step):
        turn = Rotation.from_rotvec(-step[:3]).as_matrix()
        start = np.r_[(turn @ state[:9].reshape(3, 3)).ravel(), state[9:] + step[3:]]
        return solve_ivp(rate, (0, 5.0), start, rtol=1e-11, atol=1e-12).y[:, -1]

    middle = end(np.zeros(6))
    columns = []
    for k in range(6):
        h = 1e-4 * np.eye(6)[k]
        change = (end(h) - end(-h)) / 2e-4
        spin = -change[:9].reshape(3, 3) @ middle[:9].reshape(3, 3).T
        columns.append(np.r_[spin[2, 1], spin[0, 2], spin[1, 0], change[9:]])
    assert np.linalg.det(np.array(columns)) == pytest.approx(1.0, abs=1e-5)


def test_drift_trajectory_equals_scipy():
    field = DriftField(jnp.asarray(GENERAL), orbit_rate=0.1)
    state = random_state(1)
    path = drift_trajectory(field, state, 0.01, 500)
    velocity = jax.jit(lambda x: field(x))

    def rate(t, x):
        return np.asarray(velocity(x))

    solution = solve_ivp(rate, (0, 5.0), np.asarray(state), rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(path.states[-1], solution.y[:, -1], atol=1e-7)


def test_the_free_body_returns():
    """In inertial axes: the rates come back every polhode period, the attitude now and then."""
    field = DriftField(jnp.asarray(PAPER))
    state = pack(jnp.eye(3), jnp.array([0.1, -0.11, 0.1]))
    found = recurrence(field, state, radius=0.1, step=0.5, count=60_000)
    assert found.drift < 1e-3
    assert len(found.returns) >= 5
    assert found.distances.max() > 2.0
    later = found.times > found.returns[0] - 1.0
    assert found.distances[later].min() < 0.1
    with pytest.raises(ValueError, match="rate"):
        recurrence(field, pack(jnp.eye(3), jnp.zeros(3)), step=0.1, count=10)


def test_steady_spin_returns_every_revolution():
    field = DriftField(jnp.asarray(PAPER))
    state = pack(jnp.eye(3), jnp.array([0.0, 0.0, 0.2]))
    found = recurrence(field, state, radius=0.05, step=0.01, count=10_000)
    period = 2 * np.pi / 0.2
    np.testing.assert_allclose(found.returns, period * np.arange(1, 4) - 0.25, atol=0.02)


def test_energy_history_equals_scipy():
    torque = PeriodicTorque(AMPLITUDE, FREQUENCY, jnp.array([0.3, -1.0, 2.0]))
    omega = np.array([0.3, -0.2, 0.25])

    def rate(t, w):
        push = np.asarray(AMPLITUDE) * np.sin(np.asarray(FREQUENCY) * t + [0.3, -1.0, 2.0])
        return np.linalg.solve(PAPER, push - np.cross(w, PAPER @ w))

    solution = solve_ivp(rate, (0, 50.0), omega, rtol=1e-11, atol=1e-13).y[:, -1]
    ours = energy_history(jnp.asarray(PAPER), jnp.asarray(omega), torque, 0.05, 1000)
    assert float(ours[-1]) == pytest.approx(0.5 * solution @ PAPER @ solution, rel=1e-9)


def test_spin_about_one_axis_refutes_claim_18():
    """One axis, exactly: ω2 = ω + a (1 - cos Ωt) / (JΩ), so the gain is 2aω/Ω + (2a/Ω)²/(2J)."""
    amplitude = jnp.array([0.0, 0.02, 0.0])
    found = energy_counterexample(jnp.asarray(PAPER), amplitude, FREQUENCY)
    gain = 2 * 0.02 / 0.8
    assert found.gain == pytest.approx(gain + 0.5 * gain**2 / 264.6, rel=1e-10)
    assert found.excess == pytest.approx(found.gain - 0.02, rel=1e-10)
    assert found.times[-1] == pytest.approx(np.pi / 0.8)


def test_the_printed_disturbance_without_phases_refutes_claim_18():
    """A spin of 1 rad/s about y gains 0.050 J within 3.93 s, where (18) allows 0.031 J: by SciPy.

    SciPy integrates the energy beside the rates, ω·T_d, and not ½ωᵀJω.
    """

    def rate(t, state):
        push = np.asarray(AMPLITUDE) * np.sin(np.asarray(FREQUENCY) * t)
        w = state[:3]
        return [*np.linalg.solve(PAPER, push - np.cross(w, PAPER @ w)), w @ push]

    span = (0, np.pi / 0.8)
    gained = solve_ivp(rate, span, [0, 1, 0, 0], method="DOP853", rtol=1e-11, atol=1e-13).y[3, -1]
    found = energy_counterexample(jnp.asarray(PAPER), AMPLITUDE, FREQUENCY)
    np.testing.assert_array_equal(found.omega, [0, 1, 0])
    assert found.gain == pytest.approx(gained, rel=1e-9)
    assert gained == pytest.approx(0.050, abs=5e-4)
    assert found.claimed - found.energies[0] == pytest.approx(0.031)
    assert found.excess == pytest.approx(0.019, abs=5e-4)
    limit = energy_bound(jnp.asarray(PAPER), found.energies[0], AMPLITUDE, jnp.asarray(found.times))
    assert np.all(found.energies <= np.asarray(limit) * (1 + 1e-12))


def test_a_quick_torque_is_refuted_by_a_quick_spin():
    """At 40 rad/s a spin of 1 rad/s would not do; nothing oscillates: told."""
    quick = energy_counterexample(jnp.asarray(GENERAL), AMPLITUDE, 50 * FREQUENCY)
    assert quick.excess > 0
    assert np.abs(quick.omega).max() > 1
    slow = energy_counterexample(jnp.asarray(GENERAL), AMPLITUDE, 50 * FREQUENCY, spin=1.0)
    assert slow.excess < 0
    with pytest.raises(ValueError, match="oscillates"):
        energy_counterexample(jnp.asarray(PAPER), AMPLITUDE, jnp.zeros(3))
