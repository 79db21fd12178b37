"""Least part of their capacity that wheels need while other devices help."""

import numpy as np
import pytest
import scipy.optimize
from scipy.optimize import linprog

from jaxsat.controllability.filling import least_load
from jaxsat.controllability.programme import UnsolvedProgramme

STEPS, STEP = 40, 90.0


def turned(angle):
    """Matrix by which a constant vector turns in axes that turn about -y."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


def drift(torque, turn):
    """Momentum under a torque that is constant in the turning axes, and its increment in a step."""
    each, path = STEP / 2 * (turn + np.eye(3)) @ torque, [np.zeros(3)]
    for _ in range(STEPS):
        path.append(turn @ path[-1] + each)
    return np.array(path)


def test_wheels_alone_hold_the_largest_momentum_of_the_path():
    torque, turn = np.array([1e-4, -3e-4, 2e-4]), turned(STEP * 1.1e-3)
    path, capacity = drift(torque, turn), np.array([0.5, 1.0, 2.0])
    none = np.zeros((STEPS, 3, 0)), np.zeros(0), np.zeros(0)
    expected = np.abs(path / capacity).max()
    assert least_load(path, turn, np.eye(3), capacity, *none) == pytest.approx(expected, rel=1e-6)


def test_a_device_takes_out_a_part_of_a_constant_torque():
    """What it lacks adds up; one sign does not help against the other."""
    path, turn = drift(np.array([0.0, 2e-4, 0.0]), np.eye(3)), np.eye(3)
    column = np.tile(STEP * np.array([[0.0], [1e-4], [0.0]]), (STEPS, 1, 1))
    for low, high, part in ((-1.5, 1.5, 0.5), (-3.0, 0.0, 0.0), (0.0, 3.0, 2.0)):
        found = least_load(
            path, turn, np.eye(3), np.ones(3), column, np.array([low]), np.array([high])
        )
        assert found == pytest.approx(part * 1e-4 * STEP * STEPS, abs=1e-7)


def test_what_wheels_do_not_hold_is_taken_out_or_the_path_is_not_held():
    """Two wheels hold none about z; what is there at first may be taken out at once."""
    axes, path = np.eye(3)[:, :2], np.zeros((STEPS + 1, 3))
    column = np.tile(np.array([[0.0], [0.0], [1.0]]), (STEPS, 1, 1))
    path[:, 2] = np.linspace(0.5, 0.7, STEPS + 1)
    least, most = np.array([-1.0]), np.array([1.0])
    assert least_load(path, np.eye(3), axes, np.ones(2), column, least, most) == pytest.approx(0)
    assert least_load(path, np.eye(3), axes, np.ones(2), column, 0 * least, most) == np.inf


def test_four_wheels_and_rods_agree_with_a_linear_programme_in_inertial_axes():
    """There momentum is a sum of impulses; unknowns are impulses and the null motion of wheels."""
    rng = np.random.default_rng(3)
    turn = turned(STEP * 1.1e-3)
    axes = np.array([[1, 0, -1, 0], [0, 1, 0, -1], [1, 1, 1, 1]]) / np.sqrt(2)
    path, capacity = drift(np.array([2e-4, 1e-4, -1e-4]), turn), np.array([0.3, 0.2, 0.3, 0.4])
    impulses, most = 5e-3 * rng.normal(size=(STEPS, 3, 2)), np.array([0.5, 0.8])
    back = [np.eye(3)]
    for _ in range(STEPS):
        back.append(back[-1] @ turn.T)
    inverse = np.linalg.pinv(axes)
    null = np.array([1.0, -1.0, 1.0, -1.0])
    rows, sides = [], []
    for instant in range(1, STEPS + 1):
        row = np.zeros((4, 2 * STEPS + STEPS + 1))
        for step in range(instant):
            into = back[instant].T @ back[step + 1] @ impulses[step]
            row[:, 2 * step : 2 * step + 2] = inverse @ into
        row[:, 2 * STEPS + instant - 1] = null
        for sign in (1, -1):
            signed = sign * row
            signed[:, -1] = -capacity
            rows.append(signed)
            sides.append(-sign * inverse @ path[instant])
    bounds = [(-one, one) for _ in range(STEPS) for one in most]
    bounds += [(None, None)] * STEPS + [(0, None)]
    aim = np.append(np.zeros(3 * STEPS), 1.0)
    told = linprog(aim, A_ub=np.vstack(rows), b_ub=np.concatenate(sides), bounds=bounds)
    found = least_load(path, turn, axes, capacity, impulses, -most, most)
    alone = least_load(path, turn, axes, capacity, 0 * impulses, -most, most)
    assert found == pytest.approx(told.fun, rel=1e-6)
    assert 0.05 < found < 0.9 * alone


def test_a_method_that_fails_is_replaced_and_the_last_one_is_told(monkeypatch):
    """A failure answers nothing: it neither holds a path nor loses it."""
    answer, tried = scipy.optimize.linprog, []
    failure = scipy.optimize.OptimizeResult(status=4, message="numerical difficulties")

    def failing(number):
        def linprog(*args, method, **keys):
            tried.append(method)
            return answer(*args, method=method, **keys) if len(tried) > number else failure

        return linprog

    path, none = np.full((3, 3), 0.3), (np.zeros((2, 3, 0)), np.zeros(0), np.zeros(0))
    given = path, np.eye(3), np.eye(3), np.ones(3), *none
    monkeypatch.setattr(scipy.optimize, "linprog", failing(1))
    assert least_load(*given) == pytest.approx(0.3)
    assert tried == ["highs", "highs-ipm"]
    monkeypatch.setattr(scipy.optimize, "linprog", failing(9))
    with pytest.raises(UnsolvedProgramme, match="was not solved"):
        least_load(*given)
