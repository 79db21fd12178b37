"""Laws for two torques and a free third rate, compared on one set of cases."""

from jaxsat.comparison.acceptance import LAWS, LEVELS, LIMITS, PERIOD, Setting, horizon, scenario_of
from jaxsat.comparison.studies import Start, study_of
from jaxsat.comparison.verdict import Row, Verdict, row_of, verdict

__all__ = [
    "LAWS",
    "LEVELS",
    "LIMITS",
    "PERIOD",
    "Row",
    "Setting",
    "Start",
    "Verdict",
    "horizon",
    "row_of",
    "scenario_of",
    "study_of",
    "verdict",
]
