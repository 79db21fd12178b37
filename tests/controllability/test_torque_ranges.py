"""Thrusters between two levels against linear programmes and the cone of a zonotope's corners."""

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.cone import torque_cone
from jaxsat.controllability.torque_ranges import (
    judge_ranges,
    opposing_share,
    stuck_on_words,
    torque_reserve,
)

INERTIA = (0.3, 0.55, 0.62)
PAIRS = np.kron(np.diag([1.0, 2.0, 0.5]), [1, -1])
"""One thruster for each sign of each axis."""


def drawn(seed, count=6):
    random = np.random.default_rng(seed)
    torques = random.normal(size=(3, count))
    low = np.where(random.uniform(size=count) < 0.5, 0.0, random.uniform(0, 0.6, count))
    return torques, low, low + random.uniform(0.2, 1.0, count)


def reach(torques, low, high, direction):
    """The largest torque along a direction alone, by a linear programme; minus infinity if none."""
    count = torques.shape[1]
    system = np.hstack([torques, -direction[:, None]])
    bounds = [*zip(low, high, strict=True), (None, None)]
    found = linprog([*np.zeros(count), -1.0], A_eq=system, b_eq=np.zeros(3), bounds=bounds)
    return -np.inf if found.x is None else -found.fun


@pytest.mark.slow
def test_the_reserve_is_the_least_reach_over_all_directions():
    inside = 0
    for seed in range(12):
        one = drawn(seed)
        random = np.random.default_rng(seed)
        directions = random.normal(size=(80, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        least = min(reach(*one, direction) for direction in directions)
        reserve = torque_reserve(*one)
        assert (reserve > 0) == (least > 0)
        if reserve > 0:
            inside += 1
            assert reserve <= least + 1e-9
            assert least < 2 * reserve
    assert 2 <= inside <= 10


@pytest.mark.parametrize(("failed", "level"), [(0, 0.0), (3, 0.0), (5, 0.97), (2, 0.4)])
def test_pairs_with_one_held_leave_what_the_corners_of_all_torques_span(failed, level):
    low, high = np.zeros(6), np.ones(6)
    low[failed] = high[failed] = level
    corners = PAIRS @ np.array(list(itertools.product(*zip(low, high, strict=True)))).T
    left = corners[:, np.linalg.norm(corners, axis=0) > 0]
    cone = torque_cone(left, np.zeros(left.shape[1], bool))
    judgement = judge_ranges(INERTIA, actuator_set(PAIRS), low, high)
    assert judgement.cone.two_sided == cone.two_sided
    assert judgement.laws == ("three torques" if cone.two_sided == 3 else "two torques")
    assert (cone.two_sided == 3) == (0 < level < 1)


def test_random_ranges_agree_with_the_corners():
    for seed in range(30):
        torques, low, high = drawn(100 + seed, 5)
        judgement = judge_ranges(INERTIA, actuator_set(torques), low, high)
        balanced = linprog(
            np.zeros(5), A_eq=torques, b_eq=np.zeros(3), bounds=list(zip(low, high, strict=True))
        )
        assert (judgement is None) == (balanced.x is None)
        if judgement is not None:
            corners = torques @ np.array(list(itertools.product(*zip(low, high, strict=True)))).T
            cone = torque_cone(corners, np.zeros(corners.shape[1], bool))
            assert judgement.cone.two_sided == cone.two_sided == 3


@pytest.mark.parametrize(("failed", "level"), [(3, 1.0), (5, 0.97), (2, 0.4), (0, 0.0)])
def test_of_a_pair_one_opposes_the_other_with_the_same_share(failed, level):
    low, high = np.zeros(6), np.ones(6)
    low[failed] = high[failed] = level
    assert opposing_share(PAIRS, low, high) == pytest.approx(level)
    stronger = PAIRS * np.where(np.arange(6) == failed, 1.0, 1.25)
    assert opposing_share(stronger, low, high) == pytest.approx(level / 1.25)
    judgement = judge_ranges(INERTIA, actuator_set(PAIRS), low, high)
    assert (judgement is None) == (level == 1)


def test_ranges_with_a_little_less_than_the_share_do_not_balance():
    finite = 0
    for seed in range(20):
        torques, low, high = drawn(300 + seed, 5)
        share = opposing_share(torques, low, high)
        if not 0 < share < np.inf:
            continue
        finite += 1
        for part, balances in ((0.999 * share, False), (1.001 * share, True)):
            bounds = list(zip(low, low + part * (high - low), strict=True))
            found = linprog(np.zeros(5), A_eq=torques, b_eq=np.zeros(3), bounds=bounds)
            assert (found.x is not None) == balances
    assert finite >= 5


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_the_share_is_that_of_a_linear_programme_whatever_the_torques_span(rank):
    """Also with thrusters that are parallel, of both signs, or held."""
    random, finite = np.random.default_rng(rank), 0
    for _ in range(100):
        count = random.integers(2, 8)
        torques = np.zeros((3, count))
        torques[:rank] = random.integers(-2, 3, (rank, count))
        low = random.choice([0, 0, -1, 0.3, 1], count)
        high = low + random.choice([0, 0.5, 1], count)
        least = np.clip(0.0, low, high)
        ranges = np.hstack([torques * (high - least), torques * (low - least)])
        programme = linprog(
            np.eye(2 * count + 1)[-1],
            A_ub=np.hstack([np.eye(2 * count), -np.ones((2 * count, 1))]),
            b_ub=np.zeros(2 * count),
            A_eq=np.hstack([ranges, np.zeros((3, 1))]),
            b_eq=-torques @ least,
        )
        expected = programme.fun if programme.status == 0 else np.inf
        finite += 0 < expected < np.inf
        assert opposing_share(torques, low, high) == pytest.approx(expected, rel=1e-9)
    assert finite >= 10


def test_a_constant_torque_across_all_others_has_no_share():
    low = np.array([0.0, 0, 0, 0, 1])
    assert opposing_share(PAIRS[:, :5], low, np.ones(5)) == np.inf


def test_nothing_opposes_a_thruster_stuck_on_that_is_alone_on_its_side():
    low, high = np.zeros(5), np.ones(5)
    low[4] = 1.0
    assert judge_ranges(INERTIA, actuator_set(PAIRS[:, :5]), low, high) is None


@pytest.mark.parametrize(
    ("columns", "two_sided", "words"),
    [
        (PAIRS, False, "the others oppose none of 6 thrusters; g1, g2, g3, g4, g5, g6 would take"),
        (PAIRS * [1, 2, 1, 1, 1, 1], False, "oppose 1 of 6 thrusters; g1 takes most, 50 %"),
        (PAIRS[:, :5], False, "the others oppose none of 5 thrusters; g1, g2, g3, g4 would take"),
        (PAIRS[:, 1:], [True, False, False, False, False], "none of 5 thrusters; g2, g3, g4, g5"),
    ],
)
def test_one_thruster_stuck_on_is_said_to_be_opposed_where_others_balance_it(
    columns, two_sided, words
):
    assert words in stuck_on_words(INERTIA, actuator_set(columns, two_sided=two_sided))


def test_what_is_left_beside_a_thruster_stuck_on_may_not_control_every_axis():
    plane = actuator_set(np.array([[1.0, -2, 0, 0], [0, 0, 1, -1], [0, 0, 0, 0]]))
    assert "oppose 1 of 4 thrusters; g1 takes most, 50 %" in stuck_on_words(INERTIA, plane)
    assert "they do not control" not in stuck_on_words(INERTIA, plane)
    assert "after g1 they do not control" in stuck_on_words((0.3, 0.3, 0.5), plane)  # no drift


def test_thrusters_of_both_signs_have_no_sentence_on_sticking():
    assert stuck_on_words(INERTIA, actuator_set(np.eye(3), two_sided=True)) is None
