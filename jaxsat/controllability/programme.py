"""Linear programmes, and those whose solution rounding prevents."""

from typing import Any

from jaxsat.core.errors import JaxsatError

METHODS = ("highs", "highs-ipm", "highs-ds")
"""Methods in the order in which they are tried."""

OPTIMAL, INFEASIBLE, UNBOUNDED = 0, 2, 3
"""Statuses of SciPy that answer a programme; others say that the method failed."""


class UnsolvedProgramme(JaxsatError, ArithmeticError):
    """A linear programme that no method solves, so that it answers nothing."""

    failure = True


def solve(aim: Any, **constraints: Any) -> Any:
    """Minimise `aim` under the `constraints` of SciPy's `linprog`, and return its result.

    The status of the result is one of `OPTIMAL`, `INFEASIBLE` and `UNBOUNDED`. Raises
    `UnsolvedProgramme` where every method fails.
    """
    from scipy.optimize import linprog  # slow, and most studies do not need it

    failures = []
    for method in METHODS:
        solution = linprog(aim, method=method, **constraints)
        if solution.status in (OPTIMAL, INFEASIBLE, UNBOUNDED):
            return solution
        failures.append(f"{method}: {solution.message}")
    raise UnsolvedProgramme(f"The linear programme was not solved ({'; '.join(failures)}).")
