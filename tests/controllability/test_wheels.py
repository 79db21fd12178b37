"""Wheels on their momentum level set, against integration and brackets by differentiation."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.judging import judge
from jaxsat.controllability.lie import lie_bracket
from jaxsat.controllability.wheels import momentum_level_set, one_wheel_brackets
from jaxsat.controllability.wording import momentum_words, verdict_sentence

JA = np.array([[9.0, 0.5, -0.3], [0.5, 5.0, 0.8], [-0.3, 0.8, 7.0]])
AXES = np.array([[1.0, 0.3, 0.1], [0.2, -1.0, 0.5], [0.5, 0.4, 1.0]])


def level_set(inertia, axes, momentum=(0.0, 0.0, 0.0), coasting=(0.0, 0.0, 0.0)):
    """By wheels along `axes` beside three of which all motors are dead."""
    count = axes.shape[1]
    everything = actuator_set(
        wheel_axes=np.hstack([axes, np.eye(3)]),
        momentum=momentum,
        stored=np.array([*np.zeros(count), *coasting]),
    )
    return momentum_level_set(inertia, everything.only(range(count)))


def rank_by_brackets(inertia, axes, momentum, coasting=(0.0, 0.0, 0.0)):
    """Rank, in attitude and wheel momenta, of brackets up to depth 4 and two of three letters."""
    inverse, axes, fixed = jnp.linalg.inv(inertia), jnp.asarray(axes), jnp.asarray(coasting)

    def drift(state):
        attitude, stored = state[:9].reshape(3, 3), state[9:]
        x, y, z = inverse @ (attitude @ jnp.asarray(momentum) - axes @ stored - fixed)
        turn = jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return jnp.concatenate([(-turn @ attitude).reshape(9), jnp.zeros_like(stored)])

    def wheel(number):
        unit = jnp.zeros(9 + axes.shape[1]).at[9 + number].set(1.0)
        return lambda state: unit + 0 * state

    rng = np.random.default_rng(4)
    attitude, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    state = jnp.concatenate([jnp.asarray(attitude).reshape(9), jnp.full(axes.shape[1], 0.0)])
    # With no momentum the level set is taken at rest, its state of lowest rank.
    state = state.at[9:].set(
        rng.normal(size=axes.shape[1]) * (np.any(momentum) or np.any(coasting))
    )
    controls = [wheel(number) for number in range(axes.shape[1])]
    second = [lie_bracket(drift, control) for control in controls]
    third = [lie_bracket(drift, field) for field in second]
    third += [lie_bracket(a, b) for a, b in itertools.combinations(second, 2)]
    fourth = [lie_bracket(a, b) for a in second for b in third]
    words = [*controls, *second, *third, *fourth]
    return int(np.linalg.matrix_rank(np.stack([word(state) for word in words]), tol=1e-9))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("momentum", [(0.0, 0.0, 0.0), (0.3, -0.8, 0.5)])
def test_rank_is_that_of_the_brackets(count, momentum):
    found = level_set(JA, AXES[:, :count], momentum)
    assert found.rank == rank_by_brackets(JA, AXES[:, :count], momentum)
    assert found.dimension == 3 + count
    assert (found.rank == found.dimension) == (count > 1 or any(momentum))


BIAS = (0.2, 0.5, -0.1)


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("momentum", [(0.0, 0.0, 0.0), (0.3, -0.8, 0.5)])
def test_rank_beside_coasting_wheels_is_that_of_the_brackets(count, momentum):
    found = level_set(JA, AXES[:, :count], momentum, BIAS)
    assert found.rank == rank_by_brackets(JA, AXES[:, :count], momentum, BIAS)
    assert found.rank == found.dimension


def test_rest_beside_a_coasting_wheel_is_where_its_momentum_fits():
    """All attitudes are tried for one at which Jω = CH - β - A h can be zero."""
    axes, turns = AXES[:, :2], Rotation.random(20_000, rng=1).as_matrix()
    normal = level_set(JA, axes).missing[:, 0]
    for momentum, coasting in [(0.4, 0.3), (0.4, 0.5), (0.0, 0.5), (0.5, 0.0)]:
        found = level_set(JA, axes, (0.0, momentum, 0.0), coasting * normal)
        assert found.coasting == pytest.approx(coasting)
        left = (turns @ np.array([0.0, momentum, 0.0])) @ normal - coasting
        assert found.rests == (left.min() < 0 < left.max())
    along = level_set(JA, axes, (0.0, 0.0, 0.0), axes[:, 0])
    assert along.coasting == 0
    assert along.rests


@pytest.mark.slow
@pytest.mark.parametrize(
    ("moments", "axis", "rank"), [((5.0, 5.0, 7.0), 2, 2), ((9.0, 5.0, 7.0), 2, 4)]
)
def test_one_wheel_along_a_principal_axis(moments, axis, rank):
    axes = np.eye(3)[:, [axis]]
    assert level_set(np.diag(moments), axes, (0.3, -0.8, 0.5)).rank == rank
    assert rank_by_brackets(np.diag(moments), axes, (0.3, -0.8, 0.5)) == rank


@pytest.mark.parametrize("momentum", [0.0, 0.4])
def test_two_wheels_keep_the_momentum_about_their_normal(momentum):
    axes = AXES[:, :2]
    found = level_set(JA, axes, (0.0, 0.0, momentum))
    normal = found.missing[:, 0]
    np.testing.assert_allclose(normal @ axes, 0, atol=1e-15)

    def flow(time, state):
        attitude, omega, stored = state[:9].reshape(3, 3), state[9:12], state[12:]
        torque = np.array([np.sin(time), np.cos(1.7 * time)])
        total = JA @ omega + axes @ stored
        x, y, z = omega
        turn = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rate = np.linalg.solve(JA, axes @ torque - np.cross(omega, total))
        return np.concatenate([(-turn @ attitude).reshape(9), rate, -torque])

    start = np.concatenate([np.eye(3).reshape(9), np.linalg.solve(JA, [0, 0, momentum]), [0, 0]])
    states = solve_ivp(flow, (0, 20), start, rtol=1e-10, atol=1e-12).y.T
    for state in states:
        total = state[:9].reshape(3, 3) @ [0, 0, momentum]
        np.testing.assert_allclose(normal @ JA @ state[9:12], normal @ total, atol=1e-7)
    if momentum == 0.0:
        assert np.max(np.abs(states[:, 9:12])) > 0.05
        assert np.max(np.abs(states[:, 9:12] @ JA @ normal)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("moments", "torque", "axis"),
    [
        ((5.0, 5.0, 7.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
        ((5.0, 5.0, 7.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
        ((9.0, 5.0, 7.0), (1.0, 2.0, 3.0), (0.0, 0.0, 1.0)),
    ],
)
def test_one_wheel_beside_a_thruster_has_the_rank_of_the_brackets(moments, torque, axis):
    inertia, axis = jnp.diag(jnp.array(moments)), jnp.array(axis)
    inverse = jnp.linalg.inv(inertia)

    def drift(state):
        attitude, omega, stored = state[:9].reshape(3, 3), state[9:12], state[12]
        x, y, z = omega
        turn = jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        rate = -inverse @ jnp.cross(omega, inertia @ omega + axis * stored)
        return jnp.concatenate([(-turn @ attitude).reshape(9), rate, jnp.zeros(1)])

    def constant(rate, stored):
        value = jnp.concatenate([jnp.zeros(9), inverse @ rate, jnp.array([stored])])
        return lambda state: value + 0 * state

    inputs = [constant(jnp.array(torque), 0.0), constant(axis, -1.0)]
    second = [lie_bracket(drift, field) for field in inputs]
    third = [lie_bracket(a, b) for a in second for b in inputs]
    fourth = [lie_bracket(drift, field) for field in third]
    fifth = [lie_bracket(a, b) for a in fourth for b in inputs]
    turned = [lie_bracket(a, b) for a in second for b in second]
    state = jnp.concatenate([jnp.eye(3).reshape(9), jnp.zeros(4)])
    words = [*inputs, *second, *third, *fourth, *fifth, *turned]
    values = np.stack([word(state) for word in words])[:, :12]  # attitude and rate
    torques, _ = one_wheel_brackets(
        np.asarray(inertia), np.array([torque]).T, np.asarray(axis), 1e-9
    )
    assert np.linalg.matrix_rank(values, tol=1e-9) == (0, 2, 5, 6)[torques.shape[1]]


def test_wheels_are_counted_by_independent_axes():
    pyramid = np.array([[1, -1, 0, 0], [0, 0, 1, -1], [1, 1, 1, 1.0]])
    assert level_set(JA, pyramid).axes == 3
    assert level_set(JA, np.array([[1, -2], [0, 0], [1, -2.0]])).axes == 1
    assert level_set(JA, np.zeros((3, 2))).axes == 0
    assert level_set(JA, np.zeros((3, 0))).dimension == 3
    near = np.array([[1, 1], [0, 1e-8], [0, 0.0]])
    assert (level_set(JA, near).axes, level_set(JA, near).borderline) == (1, True)


def test_one_wheel_without_momentum_turns_about_one_axis():
    turn = level_set(JA, AXES[:, :1]).turned_about
    np.testing.assert_allclose(np.cross(JA @ turn, AXES[:, 0]), 0, atol=1e-12)


@pytest.mark.parametrize(
    ("torques", "two_sided", "words"),
    [
        ([[0.3], [0.2], [1.0]], False, "the one thruster, which pushes one way, changes"),
        ([[0.3, 0], [0.2, 0], [1.0, 0]], True, "the one thruster, which pushes both ways, changes"),
        ([[0.3, 0], [0.2, 0], [1.0, -1]], False, "thrusters change"),
    ],
)
def test_the_verdict_of_two_wheels_says_which_thrusters_change_the_momentum(
    torques, two_sided, words
):
    """One that makes no torque changes none."""
    actuators = actuator_set(torques, two_sided=two_sided, wheel_axes=np.eye(3)[:, :2])
    judgement = judge([5.0, 7.0, 9.0], actuators)
    assert f"so that {words} the momentum in any inertial direction" in verdict_sentence(judgement)
    assert momentum_words(judgement).endswith(f"so that {words} the momentum in any direction")
