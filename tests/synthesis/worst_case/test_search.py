"""The search for the least margin in a ball, on functions of which the least value is known."""

import numpy as np
import pytest
from scipy.special import chdtr, ndtri

from jaxsat.synthesis.worst_case.search import Ball, search

pytest.importorskip("cma")

DIMENSION, FLIGHTS = 12, 2000
DIRECTION = np.arange(1.0, DIMENSION + 1)


def moved(dimension):
    """No coordinate whose meaning jumps."""
    return np.zeros(dimension, bool)


class Flown:
    """A function of normal numbers, and all that was evaluated of it."""

    def __init__(self, function):
        self.function, self.x, self.noise = function, [], []

    def __call__(self, points, noise):
        self.x += list(ndtri(points))
        self.noise += list(noise)
        return self.function(ndtri(points))

    def least(self, *spans):
        return min(self.function(np.array(self.x[begin:end])).min() for begin, end in spans)


def test_the_ball_holds_the_probability():
    ball = Ball.with_probability(DIMENSION, 0.9973)
    assert chdtr(DIMENSION, ball.radius**2) == pytest.approx(0.9973, abs=1e-12)
    small = Ball.with_probability(DIMENSION, 0.3)
    lengths = np.linalg.norm(small.draws(np.random.default_rng(1), 4000), axis=1)
    assert lengths.max() < small.radius
    inner = chdtr(DIMENSION, (0.9 * small.radius) ** 2) / 0.3
    assert (lengths < 0.9 * small.radius).mean() == pytest.approx(inner, abs=0.03)


def test_points_outside_the_ball_are_reflected_at_its_surface():
    ball = Ball(2, 2.0)
    y = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -2.5], [0.0, 5.0]])
    x = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, -1.5], [0.0, 1.0]])
    np.testing.assert_allclose(ball.reflected(y), x, atol=1e-15)


def test_a_plane_is_least_at_the_surface_of_the_ball():
    ball = Ball.with_probability(DIMENSION, 0.9973)
    flown = Flown(lambda x: 3 + x @ DIRECTION)
    common, gradients, trusted = search(flown, ball, moved(DIMENSION), FLIGHTS, 3)
    assert gradients == trusted > 0
    assert len(flown.x) == 2 * FLIGHTS - common
    assert np.linalg.norm(flown.x, axis=1).max() < ball.radius * (1 + 1e-9)
    least = 3 - ball.radius * np.linalg.norm(DIRECTION)
    searched = flown.least((0, common), (FLIGHTS, None))
    assert least <= searched < least + 0.01 * abs(least)
    assert flown.least((0, FLIGHTS)) > 0.8 * least  # chance is far from it


def test_of_two_valleys_inside_the_ball_the_deeper_one_is_found():
    ball = Ball.with_probability(3, 0.9973)
    deep, flat = np.array([1.0, -2.0, 0.5]), np.array([-1.5, 1.0, 0.0])

    def valleys(x):
        of_deep, of_flat = (((x - one) ** 2).sum(axis=-1) for one in (deep, flat))
        return np.minimum(of_deep - 1.0, 0.3 * of_flat - 0.5)

    flown = Flown(valleys)
    search(flown, ball, moved(3), 1000, 4)
    assert flown.least((0, None)) == pytest.approx(-1.0, abs=1e-6)
    best = np.argmin(valleys(np.array(flown.x)))
    np.testing.assert_allclose(flown.x[best], deep, atol=1e-3)


def test_a_search_is_repeated_by_its_seed_and_keeps_the_noise_of_its_start():
    ball = Ball.with_probability(DIMENSION, 0.99)
    one, same, other = (Flown(lambda x: x @ DIRECTION) for _ in range(3))
    for flown, seed in ((one, 5), (same, 5), (other, 6)):
        search(flown, ball, moved(DIMENSION), 200, seed)
    assert np.array_equal(one.x, same.x)
    search(Flown(lambda x: x @ DIRECTION), ball, moved(DIMENSION), 200, 2**63 - 1)
    assert not np.array_equal(one.x, other.x)
    start = np.argmin(np.array(one.x[:40]) @ DIRECTION)
    assert set(one.noise[200:220]) == {one.noise[start]}


def test_cases_without_a_finite_margin_do_not_stop_the_search():
    ball = Ball.with_probability(2, 0.9)
    flown = Flown(lambda x: np.where(x[:, 0] > 1, np.inf, np.where(x[:, 1] > 1, -np.inf, x[:, 0])))
    assert search(flown, ball, moved(2), 150, 1).common == 30
    assert len(flown.x) == 270
