"""The best of several starts, plans among them: what is found is a local optimum each time."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from jaxsat.synthesis.bounds.manoeuvre import Manoeuvre
from jaxsat.synthesis.bounds.transcription import BoundObjective, Solution, Transcription
from jaxsat.synthesis.bounds.verification import Verification, propagate

INTERVALS = 96
"""Twice those of a plan, so that each plan is among the solutions."""

ROUNDING = 1e-6
"""Of the longest duration, relative; IPOPT exceeds bounds by less."""


class Bound(NamedTuple):
    """The best solution found, its own flight, and the values of all local optima, best first.

    Not certified: no start found a better one, which proves nothing.
    """

    objective: BoundObjective
    solution: Solution
    verification: Verification
    starts: int
    values: list[float]

    def as_data(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "objective": self.objective.value,
            "value": self.solution.value,
            "duration_s": self.solution.duration,
            "starts": self.starts,
            "local_optima": self.values,
            "flown_again": self.verification._asdict(),
            "thrust_N_m": self.solution.thrust.tolist(),
            "states_quaternion_omega": self.solution.states.tolist(),
        }


def best_of_starts(
    manoeuvre: Manoeuvre,
    objective: BoundObjective,
    starts: int = 12,
    *,
    longest: float,
    seed: int = 0,
    intervals: int = INTERVALS,
    plans: Sequence[Solution] = (),
    report: Callable[[int, float], None] | None = None,
) -> Bound | None:
    """The best local optimum from `plans` and `starts` random guesses, or None where none arrives.

    It is never above that of a plan. `longest` (s) bounds the duration. `report` is told the number
    of starts done and the best value so far. Raises `ValueError` for no starts and
    `ModuleNotFoundError` without CasADi.
    """
    if starts < 1:
        raise ValueError(f"Argument `starts` must be at least 1, but got {starts}.")
    transcription = Transcription(manoeuvre, objective, longest, intervals)
    solver = transcription.solver()
    found: list[tuple[Solution, Verification]] = []

    def add(solution: Solution | None) -> None:
        if solution is None or solution.duration > longest * (1 + ROUNDING):
            return
        verification = propagate(manoeuvre, solution)
        if verification.arrives(manoeuvre):
            effort = objective is BoundObjective.EFFORT
            value = verification.effort if effort else solution.duration
            found.append((solution._replace(value=value), verification))

    for number in range(len(plans) + starts):
        if number < len(plans):
            add(plans[number])
            add(transcription.solve_near(solver, plans[number]))
        else:
            add(transcription.solve(solver, seed * 1_000_003 + number - len(plans)))
        if report is not None:
            report(number + 1, min((one.value for one, _ in found), default=float("inf")))
    if not found:
        return None
    found.sort(key=lambda pair: pair[0].value)
    best, verification = found[0]
    count = len(plans) + starts
    return Bound(objective, best, verification, count, [one.value for one, _ in found])
