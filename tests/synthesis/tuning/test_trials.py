"""Trials of points: batches, threads, derivatives, and how many trajectories they take."""

import dataclasses

import jax
import numpy as np
import pytest

from synthesis.tuning.plans import points, same_bits


@pytest.mark.slow
def test_many_points_at_once_are_the_same_as_one_by_one(plan):
    numbers = np.array([3, 0, 7])
    together = plan.smooth.differentiate(points(plan), numbers)
    assert together.derivatives.shape == (3, 3, 2)
    for i in range(3):
        alone = plan.smooth.differentiate(points(plan)[i : i + 1], numbers)
        same_bits(alone, jax.tree.map(lambda x, i=i: x[i : i + 1], together))
    threads = dataclasses.replace(plan.smooth, workers=2)
    same_bits(threads.differentiate(points(plan), numbers), together)


def test_derivatives_along_the_search_are_those_of_the_cost(plan):
    numbers, step = np.arange(4), 1e-5
    found = plan.smooth.differentiate(points(plan), numbers)
    for i in range(2):
        shift = step * np.eye(2)[i]
        costs = [
            plan.smooth.evaluate(points(plan) + sign * shift, numbers).cost for sign in (1, -1)
        ]
        expected = (costs[0] - costs[1]) / (2 * step)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(found.derivatives[..., i], expected, atol=1e-6 * scale)


def test_differences_agree_with_automatic_differentiation(plan):
    numbers = np.arange(3)
    trials = dataclasses.replace(plan.smooth, gradient="differences", half_width=1e-4)
    found, expected = (t.differentiate(points(plan), numbers) for t in (trials, plan.smooth))
    scale = np.abs(expected.derivatives).max()
    np.testing.assert_allclose(found.derivatives, expected.derivatives, atol=1e-6 * scale)
    np.testing.assert_allclose(found.outputs.cost, expected.outputs.cost, rtol=1e-12)


def test_trajectories_are_counted(plan):
    trials = dataclasses.replace(plan.smooth, counter=type(plan.smooth.counter)())
    trials.evaluate(points(plan), np.arange(5))
    assert trials.counter.trajectories == 15
    trials.evaluate(points(plan), np.arange(5), intervals=4)  # of 8
    assert trials.counter.trajectories == 15 + 15 / 2
    trials.differentiate(points(plan), np.arange(5))  # with two gains
    assert trials.counter.trajectories == 15 + 15 / 2 + 15 * 3
