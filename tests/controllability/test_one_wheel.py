"""One wheel beside thrusters that push one way: what is never left, by direct integration."""

import numpy as np
import pytest

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.barrier import separatrix_normals
from jaxsat.controllability.judging import judge
from jaxsat.controllability.wording import verdict_sentence

X, Y, _ = np.eye(3)
INERTIA = np.array([[4.0, 0.3, -0.2], [0.3, 3.0, 0.1], [-0.2, 0.1, 2.0]])


def wheel_across(normal):
    """The axis of a wheel with J⁻¹a along a normal."""
    return INERTIA @ normal / np.linalg.norm(INERTIA @ normal)


def visited(inertia, axis, start, seconds=300.0, many=120, step=0.1):
    """Directions (k, 3) of the momentum H that wheel and drift turn a `start` to, thrusters off.

    Runge-Kutta's integration of dH/dt = H × J⁻¹(H - a h) for `many` random histories of h.
    """
    rng = np.random.default_rng(1)
    inverse, momentum, seen = np.linalg.inv(inertia), np.tile(start, (many, 1)), []
    for number in range(int(seconds / step)):
        if number % 50 == 0:
            stored = rng.choice([-3.0, -0.3, 0.0, 0.3, 3.0], size=(many, 1))

        def change(now, stored=stored):
            return np.cross(now, (now - stored * axis) @ inverse)

        one = change(momentum)
        two = change(momentum + step / 2 * one)
        three = change(momentum + step / 2 * two)
        four = change(momentum + step * three)
        momentum = momentum + step / 6 * (one + 2 * two + 2 * three + four)
        if number % 5 == 0:
            seen.append(momentum)
    seen = np.concatenate(seen)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), np.linalg.norm(start), rtol=1e-4)
    return seen / np.linalg.norm(start)


def sphere(count=150):
    """Directions evenly over a sphere."""
    number = np.arange(count) + 0.5
    height, around = 1 - 2 * number / count, number * np.pi * (1 + 5**0.5)
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(around), across * np.sin(around), height], axis=1)


def farthest(seen, directions):
    """The largest angle (rad) from one of the directions to the nearest that was seen."""
    return float(np.arccos(np.clip((directions @ seen.T).max(axis=1), -1, 1)).max())


@pytest.mark.parametrize("axis", [(0.0, 0.6, 0.8), (0.5, -0.5, 0.7)])
def test_wheel_and_drift_turn_the_momentum_into_any_direction(axis):
    """So that one thruster that pushes one way can take it out, and put it anywhere."""
    axis = np.array(axis)
    for push in ((1.0, 0.0, 0.0), (0.3, -0.5, 0.8)):
        found = judge(INERTIA, actuator_set(np.array([push]).T, wheel_axes=axis[:, None]))
        assert (found.verdict, found.laws, found.rank) == ("by drift", "none", 6)
    assert farthest(visited(INERTIA, axis, np.array([0.6, 0.0, 0.8])), sphere()) < 0.2


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_across_a_separatrix_never_crosses_it(sign):
    """J⁻¹a normal to a separatrix plane: wheel and drift turn to one half of all directions."""
    (normal, _), _ = separatrix_normals(INERTIA)
    axis, other = wheel_across(normal), np.cross(normal, [0.3, 0.5, -0.8])
    one_side = sign * np.array([normal + other, 0.2 * normal - other]).T
    found = judge(INERTIA, actuator_set(one_side, wheel_axes=axis[:, None]))
    assert (found.verdict, found.rank) == ("uncontrollable", 6)
    assert found.barrier == pytest.approx(sign * normal)
    assert "m·H ≥ 0" in verdict_sentence(found)
    both = np.column_stack([one_side[:, 0], -0.4 * sign * normal + np.cross(normal, other)])
    assert judge(INERTIA, actuator_set(both, wheel_axes=axis[:, None])).verdict == "by drift"
    start = sign * normal + 0.3 * other
    seen = visited(INERTIA, axis, start / np.linalg.norm(start))
    assert (sign * seen @ normal).min() > -1e-4
    half = sphere()[sign * sphere() @ normal > 0.2]
    assert farthest(seen, half) < 0.25


def test_only_wheels_across_separatrices_keep_to_a_half_of_the_momenta():
    """b·(H × J⁻¹H) on the plane across b vanishes where `judge` finds a barrier, nowhere else."""
    rng = np.random.default_rng(4)
    seen = []
    for number in range(40):
        root = rng.normal(size=(3, 3))
        inertia = root @ root.T + 3 * np.eye(3)
        normals = separatrix_normals(inertia)[0]
        special = number % 2
        about = normals[number // 2 % 2] if special else rng.normal(size=3)
        basis = np.linalg.svd(about[None])[2][1:]
        angles = np.linspace(0, 2 * np.pi, 9)[:, None]
        momenta = np.cos(angles) * basis[0] + np.sin(angles) * basis[1]
        turn = np.cross(momenta, np.linalg.solve(inertia, momenta.T).T) @ about
        keeps = np.abs(turn).max() < 1e-12 * np.linalg.norm(about)
        axis = inertia @ about
        torques = np.column_stack([about + basis[0], about - 0.4 * basis[0] + basis[1]])
        found = judge(inertia, actuator_set(torques, wheel_axes=axis[:, None]))
        assert (found.barrier is not None) == keeps == (found.verdict == "uncontrollable")
        seen.append(keeps)
    assert seen == [bool(number % 2) for number in range(40)]


def test_a_barrier_that_rounding_decides_is_borderline():
    (normal, _), _ = separatrix_normals(INERTIA)
    axis = wheel_across(normal) + 1e-7 * np.array([1.0, -1.0, 0.5])
    torques = np.array([normal + 0.2 * X, normal - 0.2 * Y]).T
    found = judge(INERTIA, actuator_set(torques, wheel_axes=axis[:, None]))
    assert found.verdict == "borderline"
