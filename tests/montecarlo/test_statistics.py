"""Intervals, percentiles and indices against SciPy, coverage and exact values."""

import numpy as np
import pytest
from scipy import stats

from jaxsat.montecarlo import StopRule, first_order_index, percentile, sensitivity, wilson
from jaxsat.montecarlo.statistics import Sensitivities


@pytest.mark.parametrize(("k", "n"), [(0, 10), (10, 10), (3, 10), (977, 1000), (1, 1)])
def test_wilson_against_scipy(k, n):
    expected = stats.binomtest(k, n).proportion_ci(0.95, method="wilson")
    np.testing.assert_allclose(wilson(k, n), (k / n, *expected), atol=1e-12)


def test_wilson_refuses_what_is_no_fraction():
    for k, n in ((3, 2), (-1, 2), (0, 0)):
        with pytest.raises(ValueError, match="successes"):
            wilson(k, n)


def test_percentile_intervals_cover():
    """The 90 % point of an exponential distribution lies inside in about 95 of 100 samples."""
    rng, truth = np.random.default_rng(0), -np.log(0.1)
    inside = 0
    for i in range(200):
        found = percentile(rng.exponential(size=300), 90.0, resamples=200, seed=i)
        inside += found.low <= truth <= found.high
    assert 0.89 <= inside / 200 <= 0.99


@pytest.mark.parametrize(("count", "percent"), [(7, 50.0), (60, 37.0), (60, 99.0), (200, 90.0)])
def test_resamples_have_the_distribution_of_drawn_ones(count, percent):
    """Against resamples that are drawn, by the ends of the intervals at several levels."""
    values = np.sort(np.random.default_rng(4).exponential(size=count))
    drawn = np.random.default_rng(5).choice(values, (40000, count))
    expected = np.percentile(drawn, percent, axis=1)
    for level in (0.2, 0.8, 0.95):
        found = percentile(values, percent, resamples=40000, level=level)
        tails = np.array([(1 - level) / 2, (1 + level) / 2])
        below = np.array([np.mean(expected < found.low), np.mean(expected < found.high)])
        upto = np.array([np.mean(expected <= found.low), np.mean(expected <= found.high)])
        assert np.all(below - 0.012 <= tails), (level, below, upto)
        assert np.all(tails <= upto + 0.012), (level, below, upto)


def test_percentiles_are_those_of_numpy_and_may_be_infinite():
    values = np.random.default_rng(1).normal(size=501)
    for percent in (0.0, 12.3, 50.0, 99.0, 100.0):
        expected = np.percentile(values, percent)
        np.testing.assert_allclose(percentile(values, percent, resamples=5).value, expected)
    some = np.concatenate([values, np.full(100, np.inf)])
    assert percentile(some, 99.0, resamples=5).value == np.inf
    assert np.isfinite(percentile(some, 50.0, resamples=5).value)
    with pytest.raises(ValueError, match="NaN"):
        percentile(np.array([1.0, np.nan]), 50.0)


def test_first_order_indices_of_ishigami():
    """Exact: S1 = 0.3139, S2 = 0.4424, S3 = 0, with a = 7, b = 0.1."""
    x = np.random.default_rng(2).uniform(-np.pi, np.pi, (20000, 3))
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    found = {entry.name: entry for entry in sensitivity({"x": x}, y)}
    for name, exact in (("x[1]", 0.3139), ("x[2]", 0.4424), ("x[3]", 0.0)):
        assert abs(found[name].first_order - exact) < 0.02
    expected = stats.spearmanr(x[:, 0], y).statistic
    np.testing.assert_allclose(found["x[1]"].rank_correlation, expected)
    assert next(iter(sensitivity({"x": x}, y))).name == "x[2]"


def test_rank_correlations_with_ties_and_cases_left_out_are_those_of_scipy():
    """For several results at once; one of few values, one that some cases do not have."""
    rng = np.random.default_rng(8)
    x = np.round(rng.random((300, 2)) * [5, 1e9])
    whole = np.where(rng.random(300) < 0.8, x[:, 0] + rng.random(300), np.inf)
    few = (x[:, 1] > 3e8).astype(float)
    measure = Sensitivities([whole, few])
    measure.add("a", x)
    measure.add("b", x[:, :1] * 0)
    for result, found in zip((whole, few), measure.ranked(), strict=True):
        fine = np.isfinite(result)
        assert [entry.name for entry in found][-1] == "b"
        assert np.isnan(found[-1].rank_correlation)
        for entry in found[:-1]:
            column = x[fine, int(entry.name[2]) - 1]
            expected = stats.spearmanr(column, result[fine]).statistic
            np.testing.assert_allclose(entry.rank_correlation, expected, rtol=1e-12)
            np.testing.assert_allclose(entry.first_order, first_order_index(column, result[fine]))


def test_noise_has_no_first_order_index():
    rng = np.random.default_rng(3)
    found = [first_order_index(rng.random(400), rng.random(400)) for _ in range(50)]
    assert abs(np.mean(found)) < 0.01
    assert np.isnan(first_order_index(np.ones(100), rng.random(100)))
    assert np.isnan(first_order_index(rng.random(100), np.ones(100)))


def test_the_stop_rule_is_the_width_of_the_interval():
    rule = StopRule(0.02, least=50)
    assert not rule.met(49, 49)
    for settled, count in ((100, 200), (1200, 2500), (190, 200)):
        found = wilson(settled, count)
        assert rule.met(settled, count) is ((found.high - found.low) / 2 <= 0.02)
    with pytest.raises(ValueError, match="half_width"):
        StopRule(0.0)
