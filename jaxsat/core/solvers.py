"""Solvers of diffrax by name, so that diffrax is imported only at use.

Its import takes almost as long as that of JAX, and a study with a cached kernel does not need it.
"""

from typing import TYPE_CHECKING, Any

import equinox as eqx

if TYPE_CHECKING:
    from diffrax import AbstractSolver
else:
    AbstractSolver = Any

_NAMES = ("euler", "midpoint", "heun", "ralston", "bosh3", "tsit5", "dopri5", "dopri8")
SOLVERS = {name: name.capitalize() for name in _NAMES}
"""Classes of diffrax, all explicit Runge-Kutta methods, by their names in scenarios."""

HIGH_ORDER = ("tsit5", "dopri5", "dopri8")
"""Solvers that suit tight tolerances; they have a dense output of their own."""


class NamedSolver(eqx.Module):
    """One of `SOLVERS`, constructed at use. Raises `ValueError` for another name."""

    name: str = eqx.field(static=True)

    def __check_init__(self):
        if self.name not in SOLVERS:
            raise ValueError(
                f"Argument `name` must be one of {', '.join(SOLVERS)}, but got {self.name}."
            )

    def instance(self) -> AbstractSolver:
        """Return the diffrax solver of this name."""
        import diffrax  # slow

        return getattr(diffrax, SOLVERS[self.name])()


Solver = NamedSolver | AbstractSolver
"""A solver of diffrax, or its name."""


def solver_of(solver: Solver) -> AbstractSolver:
    """Return the diffrax solver, constructed if given by name."""
    return solver.instance() if isinstance(solver, NamedSolver) else solver


def class_name(solver: Solver) -> str:
    """Return the name of the solver's class."""
    return SOLVERS[solver.name] if isinstance(solver, NamedSolver) else type(solver).__name__


def known_class(solver: Solver) -> str | None:
    """Return the class in `SOLVERS` of the solver, or its base there; None for another solver."""
    if isinstance(solver, NamedSolver):
        return SOLVERS[solver.name]
    import diffrax  # already imported with the solver

    names = SOLVERS.values()
    return next((name for name in names if isinstance(solver, getattr(diffrax, name))), None)
