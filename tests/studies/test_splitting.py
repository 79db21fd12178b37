"""Splitting on margins of which the probabilities are known."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

from jaxsat.core.errors import ArgumentError
from jaxsat.studies.splitting import Space, Splitting, interval_of

SMOOTH = Space(np.zeros(3, bool), noisy=False)


def plane(probability):
    """A half space of that probability, in a direction between the axes."""
    far, direction = -ndtri(probability), np.ones(3) / np.sqrt(3)
    return lambda points, noise: far - ndtri(points) @ direction


def two_sides(probability):
    """Two half spaces far apart."""
    far = -ndtri(probability / 2)
    return lambda points, noise: far - np.abs(ndtri(points)[:, 0])


def device(probability):
    """Only the last of 8 devices, which jumps, brings a violation near."""

    def margins(points, noise):
        last = points[:, 0] >= 7 / 8
        return np.where(last, -ndtri(8 * probability), 9.0) - ndtri(points[:, 1])

    return margins


def noise_and_number(probability):
    """The sum of a number and of noise, which is a function of the number of the case."""
    far = -ndtri(probability) * np.sqrt(2)

    def margins(points, noise):
        gaussian = ndtri((noise.astype(float) + 0.5) / 2**32)
        return far - ndtri(points)[:, 0] - gaussian

    return margins


def estimates(margins, space=SMOOTH, cases=200, replications=10, seed=0):
    splitting = Splitting(space, margins, cases, seed)
    levels, reached = splitting.pilot(1e-12)
    assert reached
    return splitting.replicate(levels, replications).probabilities


@pytest.mark.parametrize(
    ("margins", "space", "probability"),
    [
        (plane, SMOOTH, 1e-6),
        (two_sides, SMOOTH, 1e-6),
        (plane, SMOOTH, 1e-3),
        (plane, SMOOTH, 0.3),
        (device, Space(np.array([True, False, False]), noisy=False), 1e-5),
        (noise_and_number, Space(np.zeros(1, bool), noisy=True), 1e-4),
    ],
)
def test_the_mean_of_many_replications_is_the_probability(margins, space, probability):
    """To 4 standard errors, which are at most 12 %."""
    found = estimates(margins(probability), space, cases=400, replications=200)
    error = found.std() / np.sqrt(len(found))
    assert error < 0.12 * probability
    assert found.mean() == pytest.approx(probability, abs=4 * error)


def test_the_interval_covers_the_probability_as_often_as_it_says():
    """100 estimates of 1e-5 from 100 cases a level; the binomial 99.9 % range of 95 % of them."""
    intervals = [
        interval_of(estimates(plane(1e-5), cases=100, seed=seed), 0.95) for seed in range(100)
    ]
    covered = sum(one.low <= 1e-5 <= one.high for one in intervals)
    assert covered >= stats.binom.ppf(0.001, 100, 0.95)
    assert np.median([one.high / one.low for one in intervals]) < 15


def test_the_interval_of_logarithms_that_scatter_little_is_that_of_student():
    draws = 1e-6 * np.exp(0.01 * np.random.default_rng(1).standard_normal(10))
    student = stats.t.interval(0.9, 9, draws.mean(), stats.sem(draws))
    found = interval_of(draws, 0.9)
    np.testing.assert_allclose(found, [draws.mean(), *student], rtol=2e-4)


def test_an_interval_where_replications_found_nothing():
    some = interval_of(np.array([0.0, 0.0, 3e-6, 0.0]), 0.95)
    assert some.value == 0.75e-6
    assert some.high / some.low > 100
    assert interval_of(np.zeros(3), 0.95) == (0.0, 0.0, np.inf)


def test_the_last_cases_are_violating_draws_of_the_space():
    """Below a level the normal numbers have the distribution of draws that are below it."""
    splitting = Splitting(SMOOTH, plane(1e-3), 1000, 3)
    levels, _ = splitting.pilot(1e-12)
    last = splitting.replicate(levels, 20).last
    violating = last.x[last.margin < 0] @ np.ones(3) / np.sqrt(3)
    far = -ndtri(1e-3)
    assert violating.min() > far
    assert violating.mean() == pytest.approx(stats.norm.pdf(far) / 1e-3, rel=0.01)


def test_a_margin_that_stops_going_down_ends_the_pilot():
    splitting = Splitting(SMOOTH, lambda points, noise: np.full(len(points), 2.0), 100, 0)
    assert splitting.pilot(1e-9)[1] is False
    infinite = Splitting(SMOOTH, lambda points, noise: np.full(len(points), np.inf), 100, 0)
    assert infinite.pilot(1e-9) == ([], False)


def test_the_pilot_looks_no_further_than_the_least_probability():
    levels, reached = Splitting(SMOOTH, plane(1e-9), 100, 0).pilot(1e-4)
    assert not reached
    assert 4 <= len(levels) <= 6


def test_few_cases_that_violate_among_many_alike_are_counted():
    """The margin is 1 but for 2 % that violate: there is no level between."""
    found = estimates(lambda points, noise: np.where(points[:, 0] < 0.02, -1.0, 1.0), cases=1000)
    assert found.mean() == pytest.approx(0.02, rel=0.2)


@pytest.mark.parametrize("cases", [5, 105])
def test_numbers_of_cases_that_chains_do_not_divide_are_refused(cases):
    with pytest.raises(ArgumentError, match="cases"):
        Splitting(SMOOTH, plane(0.1), cases, 0)
