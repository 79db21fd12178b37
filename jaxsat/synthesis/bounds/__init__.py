"""How good control can get: least time and least effort of a manoeuvre, found open loop."""

from jaxsat.synthesis.bounds.manoeuvre import End, Manoeuvre, manoeuvre_of
from jaxsat.synthesis.bounds.run import (
    UnsolvedBound,
    UnsuitableScenario,
    bound,
    end_data,
    end_text,
    require_ideal_thrusters,
    required_manoeuvre,
    tolerances_at,
)
from jaxsat.synthesis.bounds.search import (
    Bound,
    Verification,
    best_of_starts,
    plans_of,
    propagate,
    solution_of,
)
from jaxsat.synthesis.bounds.transcription import BoundObjective, Solution, Transcription

__all__ = [
    "Bound",
    "BoundObjective",
    "End",
    "Manoeuvre",
    "Solution",
    "Transcription",
    "UnsolvedBound",
    "UnsuitableScenario",
    "Verification",
    "best_of_starts",
    "bound",
    "end_data",
    "end_text",
    "manoeuvre_of",
    "plans_of",
    "propagate",
    "require_ideal_thrusters",
    "required_manoeuvre",
    "solution_of",
    "tolerances_at",
]
