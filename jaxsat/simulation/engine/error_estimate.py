"""The error of equal steps, estimated inside the program that takes them."""

from collections.abc import Callable
from typing import NamedTuple

import jax
from jaxtyping import Array, Float, PyTree

from jaxsat.simulation.assessment import IntegrationError, stop_gradient
from jaxsat.simulation.engine.program import Program
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Span(NamedTuple):
    """A time without a sample or an edge: begin and length (s), and the state at both ends."""

    begin: Float[Array, ""]
    length: Float[Array, ""]
    first: PyTree
    last: PyTree


Rate = Callable[[Float[Array, ""], PyTree], PyTree]
"""That of a state at a time (s)."""


class HalvedSteps(NamedTuple):
    """Integrates a span once more in twice as many steps, see `IntegrationError`.

    The span has been integrated in `substeps` steps. `integrate` gives the state after equal steps:
    of a rate, from a time (s) on, over a length (s), so many, from a state. `plant_at` gives the
    plant of a state at a time.
    """

    program: Program
    integrate: Callable[[Rate, Float[Array, ""], Float[Array, ""], int, PyTree], PyTree]
    substeps: int
    body: RigidBody
    plant_at: Callable[[Float[Array, ""], PyTree], PlantState]

    def after(
        self,
        error: IntegrationError | None,
        number: Array,
        rate: Rate,
        span: Span,
    ) -> IntegrationError | None:
        """The estimate with a span of interval `number`, along which `rate` is the state's.

        A program that estimates every so many intervals counts each of these for all of them.
        """
        every = self.program.error_every
        if error is None:
            return None
        begin, length, first, last = stop_gradient(span)
        end = begin + length

        def estimated():
            halved = self.integrate(rate, begin, length, 2 * self.substeps, first)
            halved = self.plant_at(end, halved)
            return error.after(self.body, length, self.plant_at(end, last), halved, float(every))

        def carried():
            return error.later(length)

        if every == 1:
            return estimated()
        return jax.lax.cond(number % every == 0, estimated, carried)
