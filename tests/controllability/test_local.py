"""Small-time and linear controllability against simulation, Riccati gains and SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm, solve_continuous_are

from jaxsat.controllability.lie import DriftField, pack, to_tangent
from jaxsat.controllability.linear import (
    _exponentials,
    gramian_time_scales,
    linear_controllability,
    lvlh_linearisation,
)
from jaxsat.controllability.local import small_time_local_controllability
from jaxsat.controllability.rank import analyse
from tests.controllability.oracles import symmetric_product

PAPER = np.array([449.5, 264.6, 312.5])
XY = np.eye(3)[:, :2]
ORBIT = 0.0011


def random_layout(seed, count):
    rng = np.random.default_rng(seed)
    second = rng.uniform(0.05, 1.0, size=3)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    inertia = q @ np.diag(second.sum() - second) @ q.T
    return 0.5 * (inertia + inertia.T), rng.normal(size=(3, count))


@pytest.mark.slow
@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_two_axes_neutralise_their_bad_brackets(seed):
    inertia, axes = random_layout(seed, 2)
    local = small_time_local_controllability(inertia, axes)
    assert local.status == "proved"
    np.testing.assert_allclose(local.bad, 0.0, atol=1e-12)
    # From the definition: ⟨w:w⟩ in span{w1, w2} (as accelerations), ⟨w1:w2⟩ outside.
    w1, w2 = (jnp.asarray(np.linalg.solve(inertia, w)) for w in local.axes.T)
    normal = jnp.cross(w1, w2)
    for w in (w1, w2):
        bad = symmetric_product(jnp.asarray(inertia), w, w)
        size = jnp.linalg.norm(bad) * jnp.linalg.norm(normal)
        assert abs(float(normal @ bad)) < 1e-10 * float(size) + 1e-14
    good = symmetric_product(jnp.asarray(inertia), w1, w2)
    assert abs(float(normal @ good)) > 0
    # The two directions span the plane of the torque axes.
    plane = np.cross(axes[:, 0], axes[:, 1])
    np.testing.assert_allclose(plane @ local.axes / np.linalg.norm(plane), 0.0, atol=1e-12)


def test_status_of_each_count_of_axes():
    def status(*args):
        return small_time_local_controllability(*args).status

    assert status(PAPER, np.eye(3)) == "proved"
    assert status(PAPER, XY) == "proved"
    assert status(PAPER, np.array([[1.0], [2.0], [3.0]])) == "disproved"
    assert status(PAPER, XY[:, :1]) == "disproved"
    assert status([5.0, 5.0, 7.0], XY) == "disproved"
    assert status([5.0 * (1 + 1e-9), 5.0, 7.0], XY) == "not decided"
    assert status(PAPER, np.zeros((3, 0))) == "disproved"


def test_one_axis_pushes_one_way_only():
    """Simulated: random short torques along one axis leave n·ω on one side, n ⟂ v, n·⟨v:v⟩ > 0."""
    inertia = np.diag([9.0, 5.0, 7.0])
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    v = np.linalg.solve(inertia, axis)
    bad = np.linalg.solve(inertia, -np.cross(v, inertia @ v))
    normal = bad - v * (v @ bad) / (v @ v)
    rng = np.random.default_rng(0)
    for _ in range(20):
        weights = rng.normal(size=6)

        def rate(t, omega, weights=weights):
            torque = axis * sum(w * np.cos(k * np.pi * t / 0.3) for k, w in enumerate(weights))
            return np.linalg.solve(inertia, torque - np.cross(omega, inertia @ omega))

        end = solve_ivp(rate, (0, 0.3), np.zeros(3), rtol=1e-10, atol=1e-14).y[:, -1]
        assert normal @ end > 0


@pytest.mark.slow
def test_linearisation_equals_the_derivative_of_the_drift():
    inertia = np.array([[9.0, 0.0, -0.7], [0.0, 5.0, 0.0], [-0.7, 0.0, 7.0]])
    state, inputs = lvlh_linearisation(inertia, XY, 0.3)
    drift = DriftField(jnp.asarray(inertia), orbit_rate=0.3)

    def velocity(error):
        from jax.scipy.linalg import expm as exponential

        x, y, z = error[:3]
        turn = jnp.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        point = pack(exponential(-turn), jnp.array([0.0, -0.3, 0.0]) + error[3:])
        return to_tangent(point, drift(point))

    np.testing.assert_allclose(velocity(jnp.zeros(6)), 0.0, atol=1e-15)
    np.testing.assert_allclose(jax.jacfwd(velocity)(jnp.zeros(6)), state, atol=1e-13)
    np.testing.assert_allclose(inertia @ inputs[3:], XY, atol=1e-14)
    with pytest.raises(ValueError, match="principal axis"):
        lvlh_linearisation(inertia + 0.1 * (1 - np.eye(3)), XY, 0.3)


@pytest.mark.parametrize(
    ("moments", "axes", "rate", "expected"),
    [
        ([9.0, 5.0, 7.0], XY, 0.5, 6),
        ([5.0, 5.0, 7.0], XY, 0.5, 5),
        ([9.0, 5.0, 7.0], XY, 0.0, 4),
        ([9.0, 5.0, 7.0], XY[:, :1], 0.5, 4),
        ([9.0, 5.0, 7.0], np.array([[1.0], [2.0], [3.0]]), 0.5, 6),
        ([9.0, 5.0, 7.0], np.eye(3), 0.0, 6),
        ([9.0, 5.0, 7.0], np.zeros((3, 2)), 0.5, 0),
    ],
)
def test_linear_ranks(moments, axes, rate, expected):
    result = linear_controllability(moments, axes, rate)
    inertia = np.diag(moments)
    e = np.array([0.0, -rate, 0.0])
    skew = lambda x: np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])  # noqa: E731
    import sympy as sp

    j = sp.nsimplify(sp.Matrix(inertia), rational=True)
    omega = sp.nsimplify(sp.Matrix(skew(e)), rational=True)
    momentum = sp.nsimplify(sp.Matrix(skew(inertia @ e)), rational=True)
    a = sp.zeros(6, 6)
    a[:3, :3], a[:3, 3:], a[3:, 3:] = -omega, sp.eye(3), j.inv() * (momentum - omega * j)
    b = sp.Matrix.vstack(sp.zeros(3, axes.shape[1]), j.inv() * sp.Matrix(axes.astype(int)))
    exact = sp.Matrix.hstack(*[a**k * b for k in range(6)]).rank()
    assert result.rank == exact == expected
    assert result.controllable == (expected == 6)
    assert (result.margin > 0) == (expected == 6)
    assert not result.borderline


def test_rank_6_5_4_at_the_orbit_rate():
    assert linear_controllability(PAPER, XY, ORBIT).rank == 6
    assert linear_controllability([449.5, 449.5, 312.5], XY, ORBIT).rank == 5
    assert linear_controllability(PAPER, XY, 0.0).rank == 4
    near = linear_controllability([449.5 * (1 + 1e-9), 449.5, 312.5], XY, ORBIT)
    assert (near.rank, near.borderline) == (6, True)


def test_matrices_reproduce_published_regulator_poles():
    """The orbital regulator of this spacecraft: its slow pole and its gains."""
    state, inputs = lvlh_linearisation(PAPER, XY, ORBIT)
    weight = np.diag(np.array([0.1, 0.1, 0.02, 0.01, 0.01, 0.001]) ** -2.0)
    riccati = solve_continuous_are(state, inputs, weight, np.eye(2) / 0.1**2)
    gain = 0.1**2 * inputs.T @ riccati
    poles = np.sort(np.linalg.eigvals(state - inputs @ gain).real)
    np.testing.assert_allclose(poles[-1], -8e-5, rtol=0.1)
    np.testing.assert_allclose(gain[0], [0.429, 0, -5.081, 35.34, 0, -1305], rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(gain[1], [0, 1, 0, 0, 25.08, 0], rtol=2e-3, atol=1e-6)


@pytest.mark.slow
def test_time_scales_have_their_exact_value_for_a_double_integrator():
    """At ω0 = 0 an angle e needs ∫u² = 12 J² e²/T³, so T = (12 J² e² / rms²)^(1/4)."""
    linear = linear_controllability(PAPER, XY, 0.0)
    times = gramian_time_scales(linear)
    exact = np.sqrt(np.sqrt(12.0) * PAPER[:2] * 0.0175)
    np.testing.assert_allclose(times[:2], exact, rtol=0.1)  # the grid of times steps by 10 %
    assert np.all(times[:2] >= exact)
    assert np.all(np.isnan(times[[2, 5]]))


@pytest.mark.slow
def test_time_scales_equal_a_discretised_least_squares_problem():
    """Least mean-square command over 400 held steps, all six states brought to zero."""
    linear = linear_controllability(PAPER, XY, ORBIT)
    times = gramian_time_scales(linear)
    errors = np.array([0.0175, 0.0175, 0.0175, 1e-3, 1e-3, 1e-3])
    for k, horizon in enumerate(times):
        step = horizon / 400
        block = np.zeros((8, 8))
        block[:6, :6], block[:6, 6:] = linear.state_matrix, linear.input_matrix
        held = expm(block * step)
        power, columns = np.eye(6), []
        for _ in range(400):
            columns.append(power @ held[:6, 6:])
            power = held[:6, :6] @ power
        reach = np.concatenate(columns, axis=1)
        scale = np.array([1.0] * 3 + [horizon] * 3)[:, None]
        start = -power @ (np.eye(6)[k] * errors[k])
        command = np.linalg.lstsq(scale * reach, scale[:, 0] * start, rcond=1e-14)[0]
        np.testing.assert_allclose(scale[:, 0] * (reach @ command), scale[:, 0] * start, atol=1e-7)
        mean_square = command @ command / 400
        assert 0.4 < mean_square <= 1.01  # T⁻⁴ to T⁻⁶ over a grid that steps by 10 %
    # Roll turns yaw's rate through the orbit rate and that must be undone; pitch is apart.
    assert np.all(times[[0, 2, 5]] > 10 * times[1])


def test_one_thruster_is_not_stlc_at_rest_yet_linear_in_orbit():
    axis = np.array([[1.0], [2.0], [3.0]])
    result = analyse(PAPER, axis, orbit_rate=ORBIT)
    assert result.local.status == "disproved"
    assert result.linear is not None
    assert result.linear.rank == 6
    tilted = np.diag(PAPER) + 5.0 * (1 - np.eye(3))
    assert analyse(tilted, axis, orbit_rate=ORBIT).linear is None
    assert analyse(tilted, axis).linear is not None


def test_exponentials_of_all_nodes_are_scipys():
    rng = np.random.default_rng(4)
    matrices = rng.standard_normal((7, 6, 6))
    for size in (0.0, 0.1, 3.0, 40.0):
        scaled = matrices * size / np.max(np.sum(np.abs(matrices), axis=1))
        expected = expm(scaled)
        np.testing.assert_allclose(
            _exponentials(scaled), expected, rtol=0, atol=1e-12 * np.max(np.abs(expected))
        )
