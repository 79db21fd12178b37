"""Intervals, percentiles and indices against SciPy, coverage and exact values."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from jaxsat.studies.sensitivities import Sensitivities, numbers_of
from jaxsat.studies.statistics import (
    Interval,
    StopRule,
    WhenDecided,
    interval_text,
    percent_texts,
    percentile,
    wilson,
)


def sensitivity(drawn, result):
    measure = Sensitivities([result])
    for name, values in drawn.items():
        measure.add(name, values)
    return measure.ranked()[0]


def first_order_index(x, y):
    return sensitivity({"x": x}, y)[0].first_order.value


@pytest.mark.parametrize(("k", "n"), [(0, 10), (10, 10), (3, 10), (977, 1000), (1, 1)])
def test_wilson_against_scipy(k, n):
    expected = stats.binomtest(k, n).proportion_ci(0.95, method="wilson")
    np.testing.assert_allclose(wilson(k, n), (k / n, *expected), atol=1e-12)


def test_wilson_refuses_what_is_no_fraction():
    for k, n in ((3, 2), (-1, 2), (0, 0)):
        with pytest.raises(ValueError, match="successes"):
            wilson(k, n)


@pytest.mark.parametrize("count", [25, 200, 1000])
@pytest.mark.parametrize("percent", [50.0, 90.0, 99.0])
def test_percentile_intervals_cover(count, percent):
    """At least 95 of 100 samples; 94 leaves room for the chance of 2,000."""
    truth = -np.log1p(-percent / 100)
    draws = np.random.default_rng(6).exponential(size=(2000, count))
    found = [percentile(row, percent) for row in draws]
    inside = np.mean([one.low <= truth <= one.high for one in found])
    assert inside >= 0.94
    few = count * (1 - percent / 100) < 3
    assert all((one.high == np.inf) is few for one in found)


@pytest.mark.parametrize(
    ("count", "percent"),
    [(1, 50.0), (7, 50.0), (25, 10.0), (60, 37.0), (500, 99.0), (10**6, 0.001), (10**6, 50.0)],
)
def test_percentile_intervals_are_the_closest_that_are_sure_enough(count, percent):
    """Against the binomial distribution of SciPy, by the order statistics at the ends."""
    values = np.arange(1.0, count + 1)
    found = percentile(values, percent)
    below = stats.binom(count, percent / 100)
    if np.isfinite(found.low):  # the percentile is below the place of `low`, one place above
        assert below.cdf(found.low - 1) <= 0.025
    assert below.cdf(max(found.low, 0)) > 0.025
    if np.isfinite(found.high):
        assert below.sf(found.high - 1) <= 0.025
    assert below.sf(min(found.high, count + 1) - 2) > 0.025


def test_percentiles_are_those_of_numpy_and_may_be_infinite():
    values = np.random.default_rng(1).normal(size=501)
    for percent in (0.0, 12.3, 50.0, 99.0, 100.0):
        expected = np.percentile(values, percent)
        np.testing.assert_allclose(percentile(values, percent).value, expected)
    some = np.concatenate([values, np.full(100, np.inf)])
    assert percentile(some, 99.0).value == np.inf
    assert np.isfinite(percentile(some, 50.0).value)
    with pytest.raises(ValueError, match="NaN"):
        percentile(np.array([1.0, np.nan]), 50.0)


def test_open_ends_are_told():
    assert interval_text(percentile(np.arange(10.0), 99.0)) == "8.91 (over 8)"
    assert interval_text(Interval(1.0, -np.inf, 2.0)) == "1 (up to 2)"
    assert interval_text(Interval(1.0, 0.5, 2.0)) == "1 (0.5 to 2)"
    assert interval_text(percentile(np.array([3.0]), 50.0)) == "3"


def test_percents_have_digits_enough_to_tell_the_ends_of_the_interval_apart():
    assert percent_texts(wilson(1998, 2000)) == ("99.90%", "99.64%", "99.97%")
    assert percent_texts(wilson(100_000, 100_000)) == ("100.0000%", "99.9962%", "100.0000%")
    assert percent_texts(Interval(0.0, 0.0, 0.0)) == ("0.00%", "0.00%", "0.00%")


def test_first_order_indices_of_ishigami():
    """Exact: S1 = 0.3139, S2 = 0.4424, S3 = 0, with a = 7, b = 0.1."""
    x = np.random.default_rng(2).uniform(-np.pi, np.pi, (20000, 3))
    y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    found = {entry.name: entry for entry in sensitivity({"x": x}, y)}
    for name, exact in (("x[1]", 0.3139), ("x[2]", 0.4424), ("x[3]", 0.0)):
        index = found[name].first_order
        assert abs(index.value - exact) < 0.02
        assert index.low <= exact <= index.high
        assert found[name].matters is (exact > 0)
    expected = stats.spearmanr(x[:, 0], y).statistic
    np.testing.assert_allclose(found["x[1]"].rank_correlation.value, expected)
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
        assert np.isnan(found[-1].rank_correlation.value)
        assert not found[-1].matters
        for entry in found[:-1]:
            column = x[fine, int(entry.name[2]) - 1]
            expected = stats.spearmanr(column, result[fine]).statistic
            np.testing.assert_allclose(entry.rank_correlation.value, expected, rtol=1e-12)
            index = first_order_index(column, result[fine])  # without the cases left out
            np.testing.assert_allclose(entry.first_order.value, index)


def test_noise_has_no_first_order_index():
    rng = np.random.default_rng(3)
    found = [first_order_index(rng.random(400), rng.random(400)) for _ in range(50)]
    assert abs(np.mean(found)) < 0.01
    assert np.isnan(first_order_index(np.ones(100), rng.random(100)))
    assert np.isnan(first_order_index(rng.random(100), np.ones(100)))


def test_one_case_that_differs_is_explained_by_no_number():
    """In bins of 25 the index is exactly zero, whose sign rounding errors decide."""
    for case in range(200):
        sensitivities = Sensitivities([(np.arange(200) != case).astype(float)])
        sensitivities.add("x", np.arange(200))
        ((entry,),) = sensitivities.ranked()
        assert entry.first_order.value == 0.0
        assert not entry.matters
        assert entry.first_order.high < 0.05


@pytest.mark.parametrize("count", [40, pytest.param(300, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["exponential", "lognormal", "settled"])
def test_where_nothing_matters_nothing_is_listed(kind, count):
    """In 39 of 40 studies, however many numbers are dispersed and whatever the result's tail."""
    rng, listed = np.random.default_rng(7), 0
    draw = {
        "exponential": lambda: rng.exponential(size=count),
        "lognormal": lambda: rng.lognormal(0, 2, count),
        "settled": lambda: (rng.random(count) < 0.9).astype(float),
    }[kind]
    for _ in range(100):
        found = sensitivity({"x": rng.random((count, 8))}, draw())
        listed += any(entry.matters for entry in found)
    assert listed / 100 <= 0.07


def test_intervals_of_indices_and_correlations_cover():
    """Settling with probability 0.2 + 0.6 x, and y = x + noise, both normal."""
    rng, inside, rounds = np.random.default_rng(9), np.zeros(2), 150
    for _ in range(rounds):
        x = rng.random(400)
        index = sensitivity({"x": x[:, None]}, rng.random(400) < 0.2 + 0.6 * x)[0].first_order
        inside[0] += index.low <= 0.12 <= index.high
        x = rng.normal(size=400)
        rank = sensitivity({"x": x[:, None]}, x + rng.normal(size=400))[0].rank_correlation
        inside[1] += rank.low <= 6 / np.pi * np.arcsin(np.sqrt(0.5) / 2) <= rank.high
    assert np.all(inside / rounds >= 0.92)


def test_a_quaternion_is_told_as_angle_and_axis():
    """The same for both signs, and against SciPy's rotation vector."""
    q = np.random.default_rng(3).normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    found = numbers_of("attitude", q)
    vector = Rotation.from_quat(q, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(found["attitude[angle]"], np.linalg.norm(vector, axis=1))
    axis = np.stack([found[f"attitude[axis {i}]"] for i in (1, 2, 3)], axis=1)
    np.testing.assert_allclose(axis * found["attitude[angle]"][:, None], vector, atol=1e-12)
    for name, column in numbers_of("attitude", -q).items():
        np.testing.assert_allclose(column, found[name], atol=1e-15)
    at_rest = numbers_of("attitude", np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert [float(column[0]) for column in at_rest.values()] == [0.0] * 4
    result = found["attitude[angle]"] + np.where(q[:, 0] < 0, 1e-3, 0.0)
    assert sensitivity({"attitude": q}, result)[0].name == "attitude[angle]"


def test_the_stop_rule_is_the_width_of_the_interval():
    rule = StopRule(0.02, least=50)
    assert not rule.met(49, 49)
    for settled, count in ((100, 200), (1200, 2500), (190, 200)):
        found = wilson(settled, count)
        assert rule.met(settled, count) is ((found.high - found.low) / 2 <= 0.02)
    with pytest.raises(ValueError, match="half_width"):
        StopRule(0.0)


NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def likelihood_ratio(settled, count, fraction):
    """The mean likelihood over all larger fractions, by Gauss-Legendre, over that of `fraction`."""
    larger = fraction + (1 - fraction) * (NODES + 1) / 2
    alike = (larger / fraction) ** settled * ((1 - larger) / (1 - fraction)) ** (count - settled)
    return WEIGHTS @ alike / 2


@pytest.mark.parametrize("candidates", [1, 6])
@pytest.mark.parametrize("fraction", [0.5, 0.9, 0.99])
def test_a_fraction_is_decided_by_the_ratio_of_likelihoods(fraction, candidates):
    rule, needed = WhenDecided(fraction, candidates), 40 * candidates
    for count in (10, 100, 537, 1000):
        for settled in range(max(0, count - 40), count + 1):
            above = likelihood_ratio(settled, count, fraction) >= needed
            below = likelihood_ratio(count - settled, count, 1 - fraction) >= needed
            assert rule.above(settled, count) == above
            assert rule.met(settled, count) == (above or below)


def test_none_that_settle_are_surely_below_without_a_warning():
    for count in (128, 2000, 10**6):
        assert not WhenDecided(0.99).above(0, count)
        assert WhenDecided(0.99).met(0, count)


def test_all_of_them_is_a_fraction_that_can_be_missed_and_never_exceeded():
    assert not WhenDecided(1.0).met(10**6, 10**6)
    assert WhenDecided(1.0).met(9, 10)


@pytest.mark.parametrize("candidates", [1, 6])
def test_a_fraction_at_the_edge_is_rarely_told_to_be_above_however_often_one_looks(candidates):
    """2,000 candidates that settle just 99 %, asked 250 times, every 8 cases."""
    rule, looks = WhenDecided(0.99, candidates), range(8, 2001, 8)

    def least(count):
        """The fewest that settle and are told to be above."""
        return next((n + 1 for n in range(count, -1, -1) if not rule.above(n, count)), 0)

    settled = np.cumsum(np.random.default_rng(4).random((1998, 2000)) < 0.99, axis=1)
    told = np.any(settled[:, 7::8] >= np.array([least(count) for count in looks]), axis=1)
    wrong = np.mean(told.reshape(-1, candidates).any(axis=1))
    assert 0 < wrong <= 0.025
