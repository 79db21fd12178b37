"""How good control can get: least time and least effort of a manoeuvre, found open loop."""

from jaxsat.bounds.manoeuvre import End, Manoeuvre, manoeuvre_of
from jaxsat.bounds.plans import plans_of, solution_of
from jaxsat.bounds.search import Bound, best_of_starts
from jaxsat.bounds.transcription import BoundObjective, Solution, Transcription
from jaxsat.bounds.verification import Verification, propagate

__all__ = [
    "Bound",
    "BoundObjective",
    "End",
    "Manoeuvre",
    "Solution",
    "Transcription",
    "Verification",
    "best_of_starts",
    "manoeuvre_of",
    "plans_of",
    "propagate",
    "solution_of",
]
