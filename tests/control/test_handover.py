"""Holds against a drift that is too large to balance, against motions integrated by SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.control.handover import (
    AIMED_TURN,
    ENOUGH,
    KNOWN_PERIODS,
    Handover,
    HoldRecord,
    TurnRoom,
    UnbalancedDrift,
)
from jaxsat.control.normal_form import tilt_of
from jaxsat.control.oscillatory import Slow
from jaxsat.core.attitude import WZ

DRIFT, LIMIT = 2.5e-7, 0.045


def coast(drift, known=False, clock=1000.0, sure=0.0):
    """At a `clock`, of a hold that began at 0, with an oscillation of 0.3 rad/s."""
    hold = HoldRecord(jnp.array(0.0), jnp.array(known))
    return UnbalancedDrift.of(
        hold, jnp.array(clock), jnp.array(0.3), jnp.array(drift), jnp.array(sure)
    )


def turns(drift, rate, turn):
    """The turn (rad) under a constant drift until it is beyond ± `LIMIT` on the drift's side."""

    def beyond(t, x):
        return np.sign(drift) * x[0] - LIMIT

    beyond.terminal = True
    flown = solve_ivp(
        lambda t, x: [x[1], drift], (0, 1e4), [turn, rate], events=beyond, rtol=1e-10, max_step=5.0
    )
    return flown.t[-1], flown.y[0]


@pytest.mark.parametrize("drift", [DRIFT, -DRIFT, 4e-8])
@pytest.mark.parametrize("turn", [0.0, 0.015, -0.01])
def test_a_hold_first_turns_as_far_as_aimed_against_the_drift(drift, turn):
    one = coast(drift)
    _, path = turns(drift, float(one.aim(jnp.array(turn))), turn)
    assert (np.sign(drift) * path).min() == pytest.approx(-AIMED_TURN, rel=1e-3)


def test_it_begins_at_rest_where_it_has_turned_enough():
    assert abs(coast(DRIFT).aim(jnp.array(-0.03))) < 1e-12
    assert abs(coast(-DRIFT).aim(jnp.array(0.03))) < 1e-12


def test_how_long_a_hold_lasts_against_one_that_begins_as_aimed_at():
    """The times to the limit by integration, for random slow rates and turns."""
    draws = np.random.default_rng(3)
    found = []
    for drift in (DRIFT, -DRIFT):
        one = coast(drift)
        for rate, turn in zip(
            1e-4 * draws.uniform(-1, 1, 20), 0.04 * draws.uniform(-1, 1, 20), strict=True
        ):
            aimed, _ = turns(drift, float(one.aim(jnp.array(turn))), turn)
            time, path = turns(drift, rate, turn)
            expected = time >= ENOUGH * aimed and (np.sign(drift) * path).min() > -LIMIT
            slow = Slow(jnp.array(rate), jnp.array(turn))
            assert bool(one.lasts(slow, jnp.array(LIMIT), ENOUGH)) == expected
            found.append(expected)
    assert 0 < sum(found) < len(found)


def test_a_hold_that_turns_too_far_against_the_drift_does_not_last():
    slow = Slow(jnp.array(-1.4 * np.sqrt(2 * DRIFT * LIMIT)), jnp.array(0.0))
    assert turns(DRIFT, float(slow.rate), 0.0)[1].min() < -1.5 * LIMIT
    assert not coast(DRIFT).lasts(slow, jnp.array(LIMIT), ENOUGH)
    slower = slow._replace(rate=0.7 * slow.rate)
    assert coast(DRIFT).lasts(slower, jnp.array(LIMIT), ENOUGH)


@pytest.mark.parametrize("drift", [DRIFT, -DRIFT])
def test_the_end_game_opposes_the_drift_unless_the_hold_turns_too_fast_against_it(drift):
    one, turn = coast(drift), jnp.array(0.003)
    aim = one.aim(turn)
    for rate in (aim, 0.5 * aim, -aim):
        against = one.opposed(Slow(rate, turn), 0.01)
        assert against.rate == 0
        assert against.turn == pytest.approx(np.sign(drift) * 0.01)
    assert one.opposed(Slow(1.2 * aim, turn), 0.01).rate == pytest.approx(0.2 * float(aim))


def test_what_the_end_game_balances_is_no_drift():
    assert not coast(DRIFT, sure=3e-7).drifts
    assert coast(-DRIFT, sure=1e-7).drift == pytest.approx(-1.5e-7)


def test_the_first_hold_is_judged_once_when_the_drift_is_known():
    age = KNOWN_PERIODS * 2 * np.pi / 0.3
    before, after = coast(DRIFT, clock=0.99 * age), coast(DRIFT, clock=1.01 * age)
    assert not before.judged
    assert not before.drifts
    assert after.judged
    assert after.drifts
    hold = HoldRecord.none(jnp.zeros(3)).after(jnp.array(True), jnp.array(1.01 * age), after)
    assert hold.known
    later = coast(DRIFT, known=True, clock=0.1 * age)
    assert later.drifts
    assert not later.judged


def test_oscillating_before_a_hold_is_no_age_of_it():
    """The drift is learnt while holding: the first hold is judged however late it begins."""
    age, step = KNOWN_PERIODS * 2 * np.pi / 0.3, 0.1
    begins, ends = 3 * age, 4.5 * age
    clocks = np.arange(0, ends, step)

    def cycle(hold, clock):
        now = UnbalancedDrift.of(hold, clock, *map(jnp.array, (0.3, DRIFT, 0.0)))
        return hold.after(clock >= begins, clock, now), (now.drifts, now.judged)

    _, (drifts, judged) = jax.lax.scan(cycle, HoldRecord.none(jnp.zeros(3)), clocks)
    np.testing.assert_array_equal(drifts, clocks > begins + age)
    assert clocks[judged] == pytest.approx([begins + age], abs=2 * step)


def test_a_hold_near_the_aim_begins_however_short_it_is():
    """Where the rate aimed at is below what is known of a rate, its share of time means nothing."""
    one, still = coast(1e-9), jnp.array(0.0)
    aim = float(one.aim(still))
    slow = Slow(jnp.array(aim + 3e-6), still)
    assert not one.lasts(slow, jnp.array(LIMIT), 0.999)
    assert one.lasts(slow, jnp.array(LIMIT), 0.999, jnp.array(4e-6))
    assert not one.lasts(slow, jnp.array(LIMIT), 0.999, jnp.array(2e-6))


@pytest.mark.parametrize("drifts", [False, True])
def test_a_hold_far_from_the_wanted_attitude_ends_near_the_held_one(drifts):
    """The wanted attitude is another 0.05 rad away; against a drift only that one counts."""
    handover = Handover(1e-2, leave_turn=0.07, coasts=True, leave_held=0.045)
    one = coast(DRIFT if drifts else 0.0, known=True)

    def stays(turn):
        slow = Slow(jnp.array(0.0), jnp.array(turn))
        upright, still = tilt_of(WZ([0.0, 0.0], 0.0)), jnp.zeros(3)
        given = (jnp.array(True), upright, slow, still, jnp.array(1e-7), jnp.array(0.05))
        return bool(handover(*given, one))

    assert stays(-0.044)
    assert stays(-0.046) == drifts
    assert not stays(0.021)


@pytest.mark.parametrize("normal", [(0, 0, 1), (0, -0.6, 0.8), (0.8, 0.6, 0), (0.6, 0.1, -0.79)])
def test_the_turns_that_a_held_attitude_leaves_are_those_within_the_limits(normal):
    """By SciPy's rotations of a body that turns about n from attitudes that are held."""
    room = TurnRoom(LIMIT, 1.6 * LIMIT)
    across = np.linalg.svd(np.array([normal], float))[2][1:]
    axes = np.vstack([across, np.cross(*across)])
    assert float(room.about_n(jnp.asarray(axes), jnp.zeros(3))[0]) == pytest.approx(0, abs=1e-12)
    for held in np.random.default_rng(4).uniform(-0.03, 0.03, (5, 3)):
        middle, half = room.about_n(jnp.asarray(axes), jnp.asarray(held))
        turns = float(middle) + float(half) * np.array([-1.1, -0.9, 0, 0.9, 1.1])
        angles = axes.T @ np.array([[*held[:2], turn] for turn in turns]).T
        matrices = Rotation.from_rotvec(angles.T).as_matrix()
        tilt = np.arccos(matrices[:, 2, 2])
        turn = np.arctan2(
            matrices[:, 1, 0] - matrices[:, 0, 1], matrices[:, 0, 0] + matrices[:, 1, 1]
        )
        within = (tilt < 1.6 * LIMIT) & (abs(turn) < LIMIT)
        np.testing.assert_array_equal(within, [False, True, True, True, False])


def test_a_hold_ends_where_its_held_attitude_leaves_no_more_room():
    """n is the body's third axis, so that the room is that of the turn about it."""
    axes = jnp.eye(3)
    handover = Handover(1e-2, coasts=True, room=TurnRoom(0.045, 0.07))
    same, turn = handover.around(axes, jnp.array([0.01, 0.02, 0.03]))
    assert float(turn) == pytest.approx(0.03)
    assert float(same.leave_turn) == pytest.approx(0.045)
    leaning = jnp.array([[0.8, 0, -0.6], [0, 1.0, 0], [0.6, 0, 0.8]])
    less, turn = handover.around(leaning, jnp.array([0.05, 0.0, 0.0]))
    assert float(less.leave_turn) < 0.045 / 0.8
    share = float(less.leave_turn) / 0.045
    assert float(less.enter_turn) == pytest.approx(share * float(handover.enter_turn))
    assert float(turn) < 0  # the middle is beside the target
