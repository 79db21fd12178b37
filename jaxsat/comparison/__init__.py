"""Laws for two torques and a free third rate, compared on one set of cases."""

from jaxsat.comparison.acceptance import LAWS, LEVELS, LIMITS, PERIOD, Setting, horizon, scenario_of
from jaxsat.comparison.run import (
    Comparison,
    ComparisonRun,
    UnsuitableSetting,
    compare,
    require_suitable,
    settings_of,
)
from jaxsat.comparison.studies import Start, study_of
from jaxsat.comparison.verdict import Row, Verdict, row_of, verdict, verdicts_of

__all__ = [
    "LAWS",
    "LEVELS",
    "LIMITS",
    "PERIOD",
    "Comparison",
    "ComparisonRun",
    "Row",
    "Setting",
    "Start",
    "UnsuitableSetting",
    "Verdict",
    "compare",
    "horizon",
    "require_suitable",
    "row_of",
    "scenario_of",
    "settings_of",
    "study_of",
    "verdict",
    "verdicts_of",
]
