"""What is left of wheels and how they share a torque, against NumPy's singular values."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import null_space

from jaxsat.control.diagnosis.residual import ActuatorCondition
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.reconfiguration import Rank
from jaxsat.control.wheel_allocation import LEAST_MOMENTUM, MOST_MOMENTUM, WheelAllocation
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels

PYRAMID = np.array([[1, 0, -1, 0], [0, 1, 0, -1], [1, 1, 1, 1]]) / np.sqrt(2)


def allocation(axes=PYRAMID, full=0.4, most=20.0, uneven=False, **options):
    wheels = Wheels(axes, full, most, **options)
    return WheelAllocation(WheelFilter(wheels, np.full(wheels.count, 1e-3)), uneven)


def condition(count, failed=(), part=None, flow=None):
    sound = ActuatorCondition.sound(count)
    lost = jnp.array([wheel in failed for wheel in range(count)])
    part = jnp.ones(count) if part is None else jnp.asarray(part)
    return sound._replace(
        failed=lost,
        part=jnp.where(lost, 0.0, part),
        flow=jnp.zeros(count) if flow is None else jnp.asarray(flow),
    )


find = eqx.filter_jit(WheelAllocation.find)


@eqx.filter_jit
def torques(made, found, torque, momentum, unloading):
    return made.balanced(found, made.shared(found, torque), momentum, unloading)


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_shares_are_the_weighted_least_squares(seed):
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(3, 5))
    part = rng.uniform(0.3, 1.0, 5)
    made = allocation(axes)
    found = find(made, condition(5, (2,), part), jnp.zeros(5))
    assert int(found.rank) == Rank.THREE_AXES
    kept = np.arange(5) != 2
    root = np.sqrt(np.where(np.arange(5) == 2, 0.0, part))
    unit = np.asarray(made.wheels.axes)
    expected = root[:, None] * np.linalg.pinv(unit * root)
    np.testing.assert_allclose(found.shares, expected, atol=1e-12)
    torque = 0.01 * rng.normal(size=3)
    momentum = jnp.asarray(rng.normal(size=5))
    shared = np.asarray(torques(made, found, jnp.asarray(torque), momentum, jnp.array(0.01)))
    np.testing.assert_allclose(unit @ shared, torque, atol=1e-14)
    assert shared[2] == 0
    full = np.where(kept, part, 0.0)
    idle = (shared - full * (np.linalg.pinv(unit * full) @ torque))[kept]
    assert idle @ (np.asarray(momentum)[kept] / part[kept]) > 0  # dh/dt = -torque: momenta shrink


@pytest.mark.parametrize(
    ("failed", "left"),
    [((), 0), ((0,), 0), ((0, 1), 1), ((0, 2), 1), ((0, 1, 2), 2), ((0, 1, 2, 3), 2)],
)
def test_what_is_left_is_what_singular_values_say(failed, left):
    found = find(allocation(), condition(4, failed), jnp.zeros(4))
    assert int(found.rank) == left
    kept = np.delete(PYRAMID, failed, axis=1)
    assert np.linalg.matrix_rank(kept) == (3, 2, len(kept.T))[left]
    assert np.all(np.isfinite(found.shares))
    if left == Rank.PLANE:
        normal = np.asarray(found.normal)
        np.testing.assert_allclose(normal @ kept, 0.0, atol=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1)
        torque = kept @ np.array([0.02, -0.05])
        shared = torques(allocation(), found, jnp.asarray(torque), jnp.ones(4), jnp.array(0.0))
        np.testing.assert_allclose(np.delete(shared, failed), [0.02, -0.05], atol=1e-14)


@pytest.mark.parametrize("failed", [(0, 1, 2), (1, 2, 3), (0, 2)])
def test_what_is_left_takes_the_whole_momentum_that_it_can(failed):
    """One wheel that part about its axis, two that in their plane, by NumPy's pseudo-inverse."""
    made, kept = allocation(), np.delete(np.arange(4), failed)
    found = find(made, condition(4, failed), jnp.zeros(4))
    expected = np.zeros((4, 3))
    expected[kept] = np.linalg.pinv(PYRAMID[:, kept])
    np.testing.assert_allclose(found.shares, expected, atol=1e-12)
    stored = np.arange(1.0, 5.0) * np.isin(np.arange(4), kept)
    np.testing.assert_allclose(found.shares @ (PYRAMID @ stored), stored, atol=1e-12)
    if len(kept) == 1:
        most = float(made.largest_momentum(found, jnp.zeros(3)))
        assert most == pytest.approx(MOST_MOMENTUM * 20.0)


def test_torques_beyond_the_limits_keep_their_direction():
    made = allocation()
    found = find(made, condition(4, (0,)), jnp.zeros(4))
    torque = np.array([0.9, -0.4, 0.5])
    shared = np.asarray(torques(made, found, jnp.asarray(torque), jnp.zeros(4), jnp.array(0.0)))
    assert np.abs(shared).max() == pytest.approx(0.4)
    total = PYRAMID @ shared
    np.testing.assert_allclose(np.cross(total, torque), 0.0, atol=1e-12)
    assert total @ torque > 0


def test_a_motor_makes_the_torque_beside_friction_and_in_part():
    made = allocation(coulomb_friction=0.01)
    state = condition(4, (), [1.0, 0.5, 1.0, 1.0], [0.0, 0.0, 0.2, 0.0])
    momentum = jnp.array([2.0, 2.0, -2.0, 0.0])
    torque = jnp.array([0.05, 0.05, 0.05, 0.05])
    asked = np.asarray(made.commands(state, momentum, torque))
    np.testing.assert_allclose(
        asked, [0.05 - 0.01, 2 * (0.05 - 0.01), 0.05 + 0.01 + 0.2 * 0.4, 0.05 + 0.01], atol=1e-15
    )
    spun = Wheels(PYRAMID, 0.4, coulomb_friction=0.01)
    piece = spun.held_piece(WheelMomenta(momentum), jnp.asarray(asked), jnp.array(0.0))
    np.testing.assert_allclose(piece.torque(momentum)[jnp.array([0, 3])], 0.05, atol=1e-15)


def test_a_braked_wheel_is_left_out_and_does_not_come_and_go():
    made, momentum = allocation(), jnp.zeros(4)
    used = find(made, condition(4, (), None, [0.85, 0, 0, 0]), momentum)
    assert float(used.usable[0]) == pytest.approx(0.15 * 0.4)
    at_less = condition(4, (), None, [0.93, 0, 0, 0])
    assert float(find(made, at_less, momentum).usable[0]) == 0
    assert float(find(made, at_less, momentum, used).usable[0]) > 0
    assert float(find(made, condition(4, (), None, [0.96, 0, 0, 0]), momentum, used).usable[0]) == 0


def test_the_momentum_of_a_slew_fits_into_the_wheels_in_every_direction():
    made, rng = allocation(), np.random.default_rng(3)
    found = find(made, condition(4, (1,)), jnp.zeros(4))
    most = float(made.largest_momentum(found, jnp.zeros(3)))
    ways = rng.normal(size=(20000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    peaks = np.abs(ways @ np.asarray(found.shares).T).max(axis=1)
    assert MOST_MOMENTUM * 20.0 / peaks.max() == pytest.approx(most, rel=1e-3)
    stored = float(made.largest_momentum(found, jnp.array([3.0, 0.0, 0.0])))
    assert stored == pytest.approx(most - 3.0)
    full = float(made.largest_momentum(found, jnp.array([300.0, 0.0, 0.0])))
    assert full == pytest.approx(LEAST_MOMENTUM / MOST_MOMENTUM * most)


@pytest.mark.parametrize("failed", [(), (1,)])
def test_wheels_of_unequal_momentum_hold_it_in_proportion_to_what_they_can(failed):
    """The least sum of squares of momentum over limit, by a pseudo-inverse; and slews within it."""
    limit, rng = np.array([40.0, 20.0, 10.0, 5.0]), np.random.default_rng(7)
    made, stored = allocation(most=limit, uneven=True), np.array([2.0, -1.5, 1.0])
    found = find(made, condition(4, failed), jnp.zeros(4))
    working = np.where(np.isin(np.arange(4), failed), 0.0, limit)
    expected = working[:, None] * np.linalg.pinv(PYRAMID * working)
    np.testing.assert_allclose(made.holding(found), expected, atol=1e-12)
    if not failed:  # balanced momenta stay, and others are driven there without any torque
        held = jnp.asarray(expected @ stored)
        none = jnp.zeros(3)
        np.testing.assert_allclose(torques(made, found, none, held, jnp.array(0.01)), 0, atol=1e-12)
        more = held + jnp.asarray(null_space(PYRAMID)[:, 0])
        back = np.asarray(torques(made, found, none, more, jnp.array(0.01)))
        np.testing.assert_allclose(PYRAMID @ back, 0, atol=1e-12)
        assert back @ np.asarray(more - held) > 0
    most = float(made.largest_momentum(found, jnp.asarray(stored)))
    ways = rng.normal(size=(20000, 3))
    ways *= most / np.linalg.norm(ways, axis=1)[:, None]
    peaks = (np.abs((ways + stored) @ expected.T) / limit).max()
    alone = np.abs(expected @ stored / limit).max()
    assert alone < peaks <= MOST_MOMENTUM + 1e-9
    assert peaks > MOST_MOMENTUM - 0.01


def test_the_loop_has_no_factorisation():
    made = allocation()
    text = jax.jit(lambda h: made.find(condition(4), h)).lower(jnp.zeros(4)).as_text()
    assert "custom_call" not in text


@pytest.mark.parametrize("failed", [(), (1,), (0, 2), (0, 1, 2)])
def test_magnetorquers_take_out_what_wheels_alone_can_make_up_for(failed):
    """The part of the momentum in the span of the wheels in use and, of two, across the field."""
    rng = np.random.default_rng(5)
    made, momentum, bias = allocation(), rng.normal(size=4), np.array([0.0, -0.3, 0.0])
    found = find(made, condition(4, failed), jnp.asarray(momentum))
    used = np.delete(np.arange(4), failed)
    axes = np.asarray(made.wheels.axes)[:, used]
    excess = axes @ momentum[used] - bias
    for field in 3e-5 * rng.normal(size=(3, 3)):
        taken = made.unloadable(found, jnp.asarray(momentum), jnp.asarray(bias), jnp.asarray(field))
        expected = excess if len(used) > 2 else np.zeros(3)
        if len(used) == 2:
            way = null_space(np.stack([null_space(axes.T)[:, 0], field / np.linalg.norm(field)]))
            expected = way @ (way.T @ excess)
        np.testing.assert_allclose(taken, expected, atol=1e-12)
    normal = jnp.asarray(3e-5 * np.asarray(found.normal))
    along = made.unloadable(found, jnp.asarray(momentum), jnp.asarray(bias), normal)
    np.testing.assert_allclose(along, excess if len(used) > 2 else np.zeros(3), atol=1e-12)
