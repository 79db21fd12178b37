"""Rows and verdicts from settling times made by hand."""

import json

import numpy as np
import pytest

from jaxsat.synthesis.comparison.acceptance import ComparisonSetting
from jaxsat.synthesis.comparison.verdict import choose_law, comparison_row


def row(law, times, paper=50.0, effort=1.0):
    times = np.asarray(times, float)
    columns = {
        "settling_time": times,
        "effort": effort * np.linspace(10.0, 20.0, len(times)),
        "peak_rate": np.linspace(0.1, 0.3, len(times)),
    }
    return comparison_row(
        ComparisonSetting("hard", 5.0, law), columns, {"settling_time": np.array([paper])}
    )


def times(settled, count, median):
    found = np.full(count, np.inf)
    found[:settled] = np.linspace(0.5 * median, 1.5 * median, settled)
    return found


def test_row_counts_cases_that_never_settle():
    """Half of all cases, not half of those that settled."""
    found = row("rate", times(40, 100, 80.0))
    assert found.settled.value == 0.4
    assert np.isinf(found.t50.value)
    assert found.effort == 15.0
    assert found.peak_rate == 0.3
    found = row("rate", times(60, 100, 80.0))
    assert found.t50.value == np.sort(found.settling_times)[49:51].mean()
    assert np.isinf(found.t90.value)


def test_plain_row_is_json():
    plain = json.loads(json.dumps(row("rate", times(0, 9, 1.0), np.inf).as_data(), allow_nan=False))
    assert plain["law"] == "rate"
    assert plain["t50"]["value"] is None
    assert plain["paper_start_settled_s"] is None


def test_the_quickest_of_the_sure_is_taken():
    slow, quick = (
        row("oscillatory", times(200, 200, 90.0)),
        row("three-slew", times(199, 200, 60.0)),
    )
    unsure = row("switching", times(100, 200, 30.0))
    found = choose_law([slow, unsure, quick])
    assert found.law == "three-slew"
    assert "not significantly fewer than oscillatory" in found.reason
    assert "significantly fewer cases settle with switching (50.0%)" in found.reason
    assert choose_law([slow, unsure]).law == "oscillatory"


def test_a_law_that_does_not_settle_is_not_taken_for_its_effort():
    """By one case no test tells the laws apart."""
    idle, works = row("rate", [np.inf], effort=0.0), row("switching", [60.0])
    found = choose_law([idle, works])
    assert found.law == "switching"
    assert "it settles in 60 s with an effort of 10 N m s; rate does not settle" in found.reason


def test_a_fraction_that_is_beaten_is_not_taken_however_quick():
    sure, quick = row("oscillatory", times(200, 200, 900.0)), row("rate", times(150, 200, 60.0))
    assert choose_law([sure, quick]).law == "oscillatory"


def test_medians_that_cannot_be_told_apart_are_said_to_be():
    mixed = np.random.default_rng(0).permutation(times(200, 200, 81.0))
    near = choose_law([row("rate", times(200, 200, 80.0)), row("switching", mixed)])
    assert "(difference in time not significant)" in near.reason
    far = choose_law([row("rate", times(200, 200, 80.0)), row("switching", 2 * mixed)])
    assert "while rate is quicker in 1" in far.reason


def test_less_effort_decides_between_times_that_cannot_be_told_apart():
    """357 s against 363 s at 1.7 times the effort, in cases of their own."""
    mixed = np.random.default_rng(1).permutation(times(200, 200, 363.0))
    quick, frugal = row("rate", times(200, 200, 357.0), effort=1.7), row("switching", mixed)
    for rows in ([quick, frugal], [frugal, quick]):
        found = choose_law(rows)
        assert found.law == "switching"
        assert "357 s (difference in time not significant), with 1.7 times" in found.reason
    slower = row("switching", times(200, 200, 363.0))  # in every case
    assert choose_law([quick, slower]).law == "rate"
    tailed = row("switching", np.where(mixed > 480, 3 * mixed, mixed))
    assert choose_law([quick, tailed]).law == "rate"


def test_a_small_difference_of_the_same_cases_is_no_chance():
    """One second in every case shows where cases are paired, whatever their spread."""
    slow = times(200, 200, 80.0) + 1.0
    found = choose_law([row("rate", times(200, 200, 80.0)), row("switching", slow)])
    assert "while rate is quicker in 200 of 200 cases" in found.reason


def test_laws_are_as_sure_if_chance_allows_their_difference_case_by_case():
    """Seven cases that one law alone settles tell, though the intervals of the fractions overlap;
    seven against five do not."""
    sure = row("oscillatory", times(195, 200, 90.0))
    beaten = row("three-slew", times(188, 200, 60.0))
    assert beaten.settled.high > sure.settled.low
    assert choose_law([sure, beaten]).law == "oscillatory"
    others = times(188, 200, 60.0)
    others[-5:] = 60.0
    assert choose_law([sure, row("three-slew", others)]).law == "three-slew"
    with pytest.raises(ValueError, match="same cases"):
        choose_law([sure, row("rate", times(10, 20, 5.0))])


def test_none_settles():
    found = choose_law([row("rate", times(0, 20, 1.0))])
    assert found.law is None
    assert "no law settled" in found.reason


@pytest.mark.parametrize("order", [1, -1])
def test_the_order_of_the_rows_does_not_matter(order):
    rows = [
        row("three-slew", times(200, 200, 60.0)),
        row("oscillatory", times(200, 200, 80.0)),
        row("rate", times(3, 200, 40.0)),
    ]
    assert choose_law(rows[::order]).law == "three-slew"
