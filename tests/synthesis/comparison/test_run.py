"""A comparison in one call from Python."""

import pytest

from jaxsat.synthesis.comparison.acceptance import ComparisonSetting
from jaxsat.synthesis.comparison.run import compare, comparison_settings, require_suitable


def test_settings_are_every_law_under_every_limit_at_every_level():
    found = comparison_settings(["rate", "switching"], ["nominal", "hard"], [5, 20])
    assert len(found) == len(set(found)) == 8
    assert found[:2] == [
        ComparisonSetting("nominal", 5.0, "rate"),
        ComparisonSetting("nominal", 5.0, "switching"),
    ]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"laws": "coast"}, "must be one of three-slew, oscillatory"),
        ({"level": "soft", "laws": "rate"}, "must be one of nominal, mc, hard, but got soft"),
    ],
)
def test_unknown_laws_and_levels_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        compare(**changes)


def test_laws_that_come_with_the_set_need_no_trial():
    require_suitable([ComparisonSetting("nominal", 5.0, "rate")])
