"""Laws compared on one set of cases: for two torques and a free third rate, or in any scenario."""

from jaxsat.synthesis.comparison.acceptance import (
    LAWS,
    LEVELS,
    LIMITS,
    MORE_LAWS,
    PERIOD,
    ComparisonSetting,
    Start,
    comparison_scenario,
    comparison_study,
    horizon,
)
from jaxsat.synthesis.comparison.front import FlownPoint, Front, FrontPoint, front
from jaxsat.synthesis.comparison.in_scenario import (
    ScenarioComparison,
    ScenarioVerdict,
    compare_in_scenario,
    scenario_under,
)
from jaxsat.synthesis.comparison.least_times import LeastTime, least_times, median_least_time
from jaxsat.synthesis.comparison.run import (
    Comparison,
    ComparisonRun,
    UnsuitableLaw,
    UnsuitableSetting,
    compare,
    comparison_settings,
    require_suitable,
)
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow,
    ComparisonVerdict,
    ScenarioSetting,
    choose_law,
    choose_laws,
    comparison_row,
    settles_fewer,
)

__all__ = [
    "LAWS",
    "LEVELS",
    "LIMITS",
    "MORE_LAWS",
    "PERIOD",
    "Comparison",
    "ComparisonRow",
    "ComparisonRun",
    "ComparisonSetting",
    "ComparisonVerdict",
    "FlownPoint",
    "Front",
    "FrontPoint",
    "LeastTime",
    "ScenarioComparison",
    "ScenarioSetting",
    "ScenarioVerdict",
    "Start",
    "UnsuitableLaw",
    "UnsuitableSetting",
    "choose_law",
    "choose_laws",
    "compare",
    "compare_in_scenario",
    "comparison_row",
    "comparison_scenario",
    "comparison_settings",
    "comparison_study",
    "front",
    "horizon",
    "least_times",
    "median_least_time",
    "require_suitable",
    "scenario_under",
    "settles_fewer",
]
