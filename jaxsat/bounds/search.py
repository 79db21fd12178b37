"""The best of several starts: what is found is a local optimum each time."""

from collections.abc import Callable
from typing import NamedTuple

from jaxsat.bounds.manoeuvre import Manoeuvre
from jaxsat.bounds.transcription import BoundObjective, Solution, Transcription
from jaxsat.bounds.verification import Verification, propagate


class Bound(NamedTuple):
    """The best solution found, its own flight, and the values of all local optima, best first.

    Not certified: no start found a better one, which proves nothing. Nor does a feedback law aim
    at the exact target, as the bound does.
    """

    objective: BoundObjective
    solution: Solution
    verification: Verification
    starts: int
    values: list[float]


def best_of_starts(
    manoeuvre: Manoeuvre,
    objective: BoundObjective,
    starts: int = 12,
    *,
    longest: float,
    seed: int = 0,
    intervals: int = 100,
    report: Callable[[int, float], None] | None = None,
) -> Bound | None:
    """The best local optimum from `starts` random guesses whose flight arrives, or None.

    `longest` (s) bounds the duration. `report` is told the number of starts done and the best
    value so far. Raises `ValueError` for no starts and `ModuleNotFoundError` without CasADi.
    """
    if starts < 1:
        raise ValueError(f"Argument `starts` must be at least 1, but got {starts}.")
    transcription = Transcription(manoeuvre, objective, longest, intervals)
    solver = transcription.solver()
    found: list[tuple[Solution, Verification]] = []
    for number in range(starts):
        solution = transcription.solve(solver, seed * 1_000_003 + number)
        if solution is not None:
            verification = propagate(manoeuvre, solution)
            if verification.arrives(rates_only=manoeuvre.rates_only):
                found.append((solution, verification))
        if report is not None:
            report(number + 1, min((one.value for one, _ in found), default=float("inf")))
    if not found:
        return None
    found.sort(key=lambda pair: pair[0].value)
    best, verification = found[0]
    return Bound(objective, best, verification, starts, [one.value for one, _ in found])
