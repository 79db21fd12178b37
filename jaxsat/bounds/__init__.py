"""How good control can get: least time and least effort of a manoeuvre, found open loop."""

from jaxsat.bounds.manoeuvre import Manoeuvre, manoeuvre_of
from jaxsat.bounds.search import Bound, best_of_starts
from jaxsat.bounds.transcription import Objective, Solution, Transcription
from jaxsat.bounds.verification import Arrival, fly

__all__ = [
    "Arrival",
    "Bound",
    "Manoeuvre",
    "Objective",
    "Solution",
    "Transcription",
    "best_of_starts",
    "fly",
    "manoeuvre_of",
]
