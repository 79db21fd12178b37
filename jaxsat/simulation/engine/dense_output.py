"""Dense output: the state within a step, from the stages of its method."""

import abc
from typing import ClassVar, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar
from jaxsat.core.solvers import NamedSolver, Solver, class_name, known_class
from jaxsat.simulation.engine.root_finding import polynomial
from jaxsat.simulation.engine.runge_kutta import tableau_of, weighted


class AbstractDenseOutput(eqx.Module):
    """A polynomial in the elapsed fraction of a step, given by rows that the step computes.

    Events are checked at the ends of `event_checks` equal parts of a step, sign changes of a torque
    at the ends of `sign_checks` parts.
    """

    rows: ClassVar[int]
    event_checks: ClassVar[int]
    sign_checks: ClassVar[int]

    @abc.abstractmethod
    def increments(
        self, step: RealScalar, rates: list[Float[Array, " n"]], increment: Float[Array, " n"]
    ) -> Float[Array, "rows n"]:
        """The rows of a step (s) from the rates at its stages and the step's own increment."""

    @abc.abstractmethod
    def at(
        self, begin: Float[Array, " n"], increments: Float[Array, "rows n"], fraction: RealScalar
    ) -> Float[Array, " n"]:
        """The state after a fraction of the step that began in `begin`."""

    @abc.abstractmethod
    def coefficients(self, increments: Float[Array, "rows n"]) -> Float[Array, "degree n"]:
        """The coefficients of the powers of the fraction, from the first power."""


class Quartic(AbstractDenseOutput):
    """Quartic through the increments until middle and end, with the rates at both ends.

    `middle` contains the stages' weights of the increment until the middle. The rows are the
    increments at the first rate, until the middle, until the end, and at the last rate.
    """

    middle: tuple[float, ...] = eqx.field(static=True)
    rows: ClassVar[int] = 4
    event_checks: ClassVar[int] = 2
    sign_checks: ClassVar[int] = 1

    def increments(self, step, rates, increment):
        """The rows of a step, by one sum over the stages."""
        middle = step * weighted(np.array(self.middle), rates)
        return jnp.stack([step * rates[0], middle, increment, step * rates[-1]])

    def at(self, begin, increments, fraction):
        """The state by the polynomials that are one for one row and zero for the others."""
        at_begin, middle, whole, at_end = increments
        x = fraction
        rest, square = 1 - x, x * x
        bend = rest * (1 - 2 * x)
        return (
            begin
            + (x * rest * bend) * at_begin
            + (16 * square * rest * rest) * middle
            + (square * (14 * x - 5 - 8 * square)) * whole
            + (square * bend) * at_end
        )

    def coefficients(self, increments):
        """The coefficients of the same polynomials."""
        at_begin, middle, whole, at_end = increments
        return jnp.stack(
            [
                at_begin,
                at_end - 4 * at_begin - 5 * whole + 16 * middle,
                5 * at_begin - 3 * at_end + 14 * whole - 32 * middle,
                2 * (at_end - at_begin) - 8 * whole + 16 * middle,
            ]
        )


class Sextic(AbstractDenseOutput):
    """Sextic polynomial, with `weights` of the stages in the coefficient of each power from 1."""

    weights: tuple[tuple[float, ...], ...] = eqx.field(static=True)
    rows: ClassVar[int] = 6
    event_checks: ClassVar[int] = 4
    sign_checks: ClassVar[int] = 2

    def increments(self, step, rates, increment):
        """The rows of a step, by one sum over the stages for each power."""
        return jnp.stack([step * weighted(np.array(row), rates) for row in self.weights])

    def at(self, begin, increments, fraction):
        """The state by Horner's rule."""
        return begin + polynomial(list(increments), fraction)

    def coefficients(self, increments):
        """The coefficients, which are the rows themselves."""
        return increments


def require_dense_output(solver: Solver) -> None:
    """Raise `ValueError` for a solver other than Tsit5, Dopri5 and Dopri8."""
    if known_class(solver) not in ("Tsit5", "Dopri5", "Dopri8"):
        raise ValueError(
            "Argument `solver` must be Tsit5, Dopri5 or Dopri8 where steps are adaptive, "
            f"but got {class_name(solver)}."
        )


def dense_output(solver: Solver) -> AbstractDenseOutput:
    """The dense output of a solver that `require_dense_output` accepts.

    The last stage of all three is at the end of the step, in the state there.
    """
    name = cast(str, known_class(solver))
    weights = np.asarray(tableau_of(NamedSolver(name.lower())).dense)
    if name == "Dopri8":
        return Sextic(tuple(map(tuple, weights.T[::-1].tolist())))  # from falling powers
    return Quartic(tuple(weights.tolist()))
