"""Laws for two torques and a free third rate, compared on one set of cases."""

from jaxsat.comparison.acceptance import (
    LAWS,
    LEVELS,
    LIMITS,
    PERIOD,
    ComparisonSetting,
    comparison_scenario,
    horizon,
)
from jaxsat.comparison.run import (
    Comparison,
    ComparisonRun,
    UnsuitableSetting,
    compare,
    comparison_settings,
    require_suitable,
    store_of,
)
from jaxsat.comparison.studies import Start, comparison_study
from jaxsat.comparison.verdict import (
    ComparisonRow,
    ComparisonVerdict,
    choose_law,
    choose_laws,
    comparison_row,
    settles_fewer,
)

__all__ = [
    "LAWS",
    "LEVELS",
    "LIMITS",
    "PERIOD",
    "Comparison",
    "ComparisonRow",
    "ComparisonRun",
    "ComparisonSetting",
    "ComparisonVerdict",
    "Start",
    "UnsuitableSetting",
    "choose_law",
    "choose_laws",
    "compare",
    "comparison_row",
    "comparison_scenario",
    "comparison_settings",
    "comparison_study",
    "horizon",
    "require_suitable",
    "settles_fewer",
    "store_of",
]
