"""The state within a step, from the stages of its method."""

import abc
from typing import ClassVar

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.engine.crossing import polynomial
from jaxsat.engine.runge_kutta import weighted


class AbstractDenseOutput(eqx.Module):
    """A polynomial in the part of a step that has gone by, given by rows that the step leaves.

    Whether a switch has been passed is looked up at the ends of `looks` equal parts of a step, and
    whether a torque has changed its sign at those of `parts`.
    """

    rows: ClassVar[int]
    looks: ClassVar[int]
    parts: ClassVar[int]

    @abc.abstractmethod
    def growth(
        self, step: Float[Array, ""], rates: list[Float[Array, " n"]], grown: Float[Array, " n"]
    ) -> Float[Array, "rows n"]:
        """The rows of a step (s) from the rates at its stages and how far the state has grown."""

    @abc.abstractmethod
    def at(
        self, begin: Float[Array, " n"], growth: Float[Array, "rows n"], part: Float[Array, ""]
    ) -> Float[Array, " n"]:
        """The state after a part of the step that began in `begin`."""

    @abc.abstractmethod
    def powers(self, growth: Float[Array, "rows n"]) -> Float[Array, "degree n"]:
        """The coefficients of the powers of the part, from the first one on."""


class Quartic(AbstractDenseOutput):
    """Fourth degree, through growth and rates at both ends and the growth until the middle.

    `middle` has the weights of the stages in the latter. The rows are growth at the rate of the
    begin, until the middle, until the end, and at the rate of the end.
    """

    middle: tuple[float, ...] = eqx.field(static=True)
    rows: ClassVar[int] = 4
    looks: ClassVar[int] = 2
    parts: ClassVar[int] = 1

    def growth(self, step, rates, grown):
        """One sum over the stages."""
        middle = step * weighted(np.array(self.middle), rates)
        return jnp.stack([step * rates[0], middle, grown, step * rates[-1]])

    def at(self, begin, growth, part):
        """By the polynomials that are one for a row and nothing for the others."""
        at_begin, middle, whole, at_end = growth
        rest, square = 1 - part, part * part
        bend = rest * (1 - 2 * part)
        return (
            begin
            + (part * rest * bend) * at_begin
            + (16 * square * rest * rest) * middle
            + (square * (14 * part - 5 - 8 * square)) * whole
            + (square * bend) * at_end
        )

    def powers(self, growth):
        """The same polynomial."""
        at_begin, middle, whole, at_end = growth
        return jnp.stack(
            [
                at_begin,
                at_end - 4 * at_begin - 5 * whole + 16 * middle,
                5 * at_begin - 3 * at_end + 14 * whole - 32 * middle,
                2 * (at_end - at_begin) - 8 * whole + 16 * middle,
            ]
        )


class Sextic(AbstractDenseOutput):
    """Sixth degree: `weights` of the stages in the coefficient of each power, from the first on."""

    weights: tuple[tuple[float, ...], ...] = eqx.field(static=True)
    rows: ClassVar[int] = 6
    looks: ClassVar[int] = 4
    parts: ClassVar[int] = 2

    def growth(self, step, rates, grown):
        """One sum over the stages for each power."""
        return jnp.stack([step * weighted(np.array(row), rates) for row in self.weights])

    def at(self, begin, growth, part):
        """By Horner's rule."""
        return begin + polynomial(list(growth), part)

    def powers(self, growth):
        """The rows themselves."""
        return growth


def dense_output(solver: diffrax.AbstractSolver) -> AbstractDenseOutput:
    """The solver's own dense output.

    Raises `ValueError` for a solver other than Tsit5, Dopri5 and Dopri8. The last stage of all
    three is at the end of the step, in the state there.
    """
    if isinstance(solver, diffrax.Tsit5):
        return Quartic(_tsit5_middle())
    # (classes, typed as functions)
    if isinstance(solver, diffrax.Dopri5):
        return Quartic(tuple(getattr(solver.interpolation_cls, "c_mid").tolist()))  # noqa: B009
    if isinstance(solver, diffrax.Dopri8):
        falling = np.asarray(getattr(solver.interpolation_cls, "eval_coeffs"))  # noqa: B009
        return Sextic(tuple(map(tuple, falling.T[::-1].tolist())))
    raise ValueError(
        "Argument `solver` must be Tsit5, Dopri5 or Dopri8 where steps are adaptive, "
        f"but got {type(solver).__name__}."
    )


def _tsit5_middle() -> tuple[float, ...]:
    """Weights of the stages in the middle of a step.

    From the factored polynomials in section 5 of Tsitouras, Comput. Math. Appl. 62 (2011).
    """
    half = 0.5

    def quadratic(linear, constant):
        return (half - linear) * half + constant

    return (
        -1.0530884977290216
        * half
        * (half - 1.3299890189751412)
        * quadratic(1.4364028541716351, 0.7139816917074209),
        0.1017 * half**2 * quadratic(2.1966568338249754, 1.2949852507374631),
        2.490627285651252793 * half**2 * quadratic(2.38535645472061657, 1.57803468208092486),
        -16.54810288924490272
        * half**2
        * (half - 1.21712927295533244)
        * (half - 0.61620406037800089),
        47.37952196281928122
        * half**2
        * (half - 1.203071208372362603)
        * (half - 0.658047292653547382),
        -34.87065786149660974 * half**2 * (half - 1.2) * (half - 2 / 3),
        2.5 * half**2 * (half - 1.0) * (half - 0.6),
    )
