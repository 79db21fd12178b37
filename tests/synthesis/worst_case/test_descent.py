"""Descents along gradients, on functions of which gradient and least value are known."""

import numpy as np
import pytest
from scipy.special import ndtri

from jaxsat.synthesis.worst_case.search import STEP, Ball, Flown, descend

DIMENSION = 5
DIRECTION = np.array([1.0, -2.0, 0.5, 0.0, 3.0])
BALL = Ball.with_probability(DIMENSION, 0.99)
INNER = BALL.radius - 2 * STEP
"""Largest distance of a descent, of which the differences stay in the ball."""

START = np.array([0.3, -0.2, 0.1, 0.4, -0.5])
MOVED = np.zeros(DIMENSION, bool)


def descent(function, whole=MOVED, most=1000):
    """A descent from START, and all normal numbers that it flew."""
    flown = []

    def evaluate(points, noise):
        assert set(noise) == {7}
        flown.extend(ndtri(points))
        return function(ndtri(points))

    start = Flown(START, 7, float(function(START)))
    found = descend(evaluate, BALL, whole, start, most)
    assert np.linalg.norm(np.reshape(flown, (-1, DIMENSION)), axis=1).max(initial=0) < BALL.radius
    return found, np.array(flown)


def test_one_gradient_finds_the_least_value_of_a_plane():
    found, flown = descent(lambda x: 3 + x @ DIRECTION)
    least = -INNER * DIRECTION / np.linalg.norm(DIRECTION)
    np.testing.assert_allclose(found.end.x, least, atol=1e-9)
    assert found.end.margin == pytest.approx(3 - INNER * np.linalg.norm(DIRECTION))
    assert len(flown) == found.flights
    assert found.gradients == found.trusted == 2  # from the surface on nothing is gained


def test_coordinates_whose_meaning_jumps_stay_and_leave_the_others_the_rest_of_the_ball():
    whole = np.array([False, True, False, False, False])
    found, flown = descent(lambda x: x @ DIRECTION, whole)
    np.testing.assert_allclose(flown[:, 1], START[1], atol=1e-12)
    others = np.where(whole, 0.0, DIRECTION)
    room = np.sqrt(INNER**2 - START[1] ** 2)
    expected = -room * others / np.linalg.norm(others) + np.where(whole, START, 0.0)
    np.testing.assert_allclose(found.end.x, expected, atol=1e-9)


def test_a_curved_valley_is_descended_to_its_bottom():
    middle = np.array([0.5, -0.4, 0.2, 0.1, 0.3])
    found, _ = descent(lambda x: ((x - middle) ** 2 * [1, 3, 1, 2, 1]).sum(axis=-1) - 1, most=2000)
    assert found.end.margin == pytest.approx(-1, abs=0.01)
    assert found.gradients == found.trusted > 3


def test_a_gradient_that_central_differences_contradict_is_not_trusted():
    """At START the margin has a corner, to whose other side it also decreases."""
    found, _ = descent(lambda x: -np.abs(x - START).sum(axis=-1))
    assert (found.gradients, found.trusted) == (1, 0)
    assert found.end.margin < 0  # a step that was flown and gains counts nevertheless


def test_a_margin_that_does_not_react_or_is_infinite_ends_the_descent():
    flat, flown = descent(lambda x: np.ones(x.shape[:-1]))
    assert (flat.gradients, flat.trusted, len(flown)) == (1, 0, DIMENSION)
    np.testing.assert_array_equal(flat.end.x, START)
    edge, _ = descent(lambda x: np.where(x[..., 0] > START[0], np.inf, 1.0))
    assert edge.trusted == 0
    ended, flown = descent(lambda x: np.full(x.shape[:-1], -np.inf))
    assert (ended.gradients, len(flown)) == (0, 0)


def test_it_flies_no_more_than_it_may():
    for most in (0, 16, 17, 40):
        found, flown = descent(lambda x: (x**2).sum(axis=-1), most=most)
        assert len(flown) == found.flights <= most
        assert found.gradients == most // 17


def test_it_does_not_begin_where_differences_would_leave_the_ball():
    start = START * (BALL.radius - 0.5 * STEP) / np.linalg.norm(START)
    found = descend(lambda points, noise: points.sum(axis=1), BALL, MOVED, Flown(start, 7, 1.0), 99)
    assert found.flights == 0
    np.testing.assert_array_equal(found.end.x, start)
