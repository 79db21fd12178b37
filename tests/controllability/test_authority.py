"""The turn time against its closed form, and its series against SciPy's motions."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.controllability.decision import turn_time
from jaxsat.controllability.failures import failure_arrays, failure_table
from jaxsat.controllability.rank import analyse

PAPER = np.array([449.5, 264.6, 312.5])
GENERAL = np.array([[9.0, 0.5, -0.3], [0.5, 5.0, 0.8], [-0.3, 0.8, 7.0]])


def closed_form(j1, j2, j3, torque):
    direct = np.sqrt(2 * max(j1, j2) / torque)
    return max(direct, (12 * j1 * j2 * j3 / abs(j1 - j2) / torque**2) ** 0.25)


@pytest.mark.parametrize("third", [190.0, 312.5, 700.0])
@pytest.mark.parametrize("torque", [1.0, 5.0])
def test_the_layout_of_the_paper(third, torque):
    moments = np.array([449.5, 264.6, third])
    found = turn_time(np.diag(moments), np.eye(3)[:, :2], torque)
    assert found == pytest.approx(closed_form(*moments, torque), rel=1e-12)


def test_it_knows_what_the_margin_does_not():
    """The least times of an independent optimiser for these three are 36.2, 37.1 and 47.8 s."""
    found = [analyse([449.5, 264.6, third], np.eye(3)[:, :2]) for third in (190, 312.5, 700)]
    assert np.ptp([one.margin for one in found]) < 1e-12
    times = [one.turn_time for one in found]
    assert times == sorted(times)
    np.testing.assert_allclose(times, [36.2, 37.1, 47.8], rtol=0.07)


def test_direct_thrust_alone():
    """Three thrusters on a sphere, whose brackets vanish: an angle of T t² / 2J."""
    assert turn_time(3.0 * np.eye(3), np.eye(3), 2.0) == pytest.approx(np.sqrt(2 * 3.0 / 2.0))


def test_units_lengths_and_axes_change_nothing_they_should_not():
    rng = np.random.default_rng(3)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    axes = rng.normal(size=(3, 2))
    plain = turn_time(GENERAL, axes)
    assert turn_time(turn @ GENERAL @ turn.T, turn @ axes) == pytest.approx(plain, rel=1e-9)
    assert turn_time(GENERAL, axes * [7.0, 0.01]) == pytest.approx(plain, rel=1e-12)
    assert turn_time(1e3 * GENERAL, axes, 1e3) == pytest.approx(plain, rel=1e-9)


@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0)])
def test_two_thrusters_turn_as_the_series_says(signs):
    """About the axis that no thruster has, SciPy's angle after a short push against the bracket."""
    inertia, time = GENERAL, 0.05
    axes = np.array([[1.0, 0.2, 0.1], [0.1, 1.0, -0.3]]).T
    axes /= np.linalg.norm(axes, axis=0)
    push = axes @ signs
    w = np.linalg.solve(inertia, push)
    normal = np.cross(*axes.T)
    momentum = normal @ angle_after(inertia, push, time)
    bracket = -np.cross(w, inertia @ w)  # J ½⟨w:w⟩
    assert momentum == pytest.approx(normal @ bracket * time**4 / 12, rel=1e-3)


def test_one_thruster_turns_as_the_series_says():
    """About the axis that neither thrust nor the first bracket has: t⁶/180 and t⁸/4032."""
    from jaxsat.controllability.decision import _columns

    axis = np.array([[0.5, 0.6, 0.7]]).T / np.linalg.norm([0.5, 0.6, 0.7])
    columns, powers = _columns(GENERAL, axis)
    np.testing.assert_array_equal(powers, [2, 4, 6, 8])
    time = 0.4
    normal = np.cross(GENERAL @ columns[:, 0], GENERAL @ columns[:, 1])
    predicted = normal @ GENERAL @ columns[:, 2] * time**6
    momentum = normal @ angle_after(GENERAL, axis[:, 0], time)
    assert momentum == pytest.approx(predicted, rel=2e-2)


def angle_after(inertia, push, time):
    """J times the integral of the rates from rest under a constant torque."""

    def rate(t, state):
        w = state[:3]
        return [*np.linalg.solve(inertia, push - np.cross(w, inertia @ w)), *w]

    found = solve_ivp(rate, (0, time), np.zeros(6), method="DOP853", rtol=1e-13, atol=1e-22)
    return inertia @ found.y[3:, -1]


def test_what_cannot_be_reached_takes_for_ever():
    for inertia, axes in (
        (np.diag([3.0, 3.0, 2.0]), np.eye(3)[:, :2]),
        (np.diag(PAPER), np.eye(3)[:, :1]),
        (GENERAL, np.zeros((3, 0))),
    ):
        assert turn_time(inertia, axes) == np.inf
        assert analyse(inertia, axes).turn_time == np.inf
    near = [
        turn_time(np.diag([3.0 * (1 + gap), 3.0, 2.0]), np.eye(3)[:, :2]) for gap in (1e-2, 1e-6)
    ]
    assert near[1] / near[0] == pytest.approx(10.0, rel=1e-2)


def test_the_table_of_failures_has_it():
    cases = failure_table(PAPER, np.eye(3))
    found = failure_arrays(cases, cases[0].working)["turn_time"]
    assert np.all(np.isfinite(found) == [case.judgement.controllable for case in cases])
    assert found[3] == pytest.approx(closed_form(*PAPER, 1.0))  # the third has failed
