"""The error of equal steps, estimated inside the program that takes them."""

from collections.abc import Callable
from typing import NamedTuple

import jax
from jaxtyping import Array, Float, PyTree

from jaxsat.simulation.assessment import IntegrationError, stop_gradient
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.runge_kutta import Tableau, explicit_step
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Span(NamedTuple):
    """A time without a sample or an edge: begin and length (s), and the state at both ends."""

    begin: Float[Array, ""]
    length: Float[Array, ""]
    first: PyTree
    last: PyTree


class HalvedSteps(NamedTuple):
    """Integrates a span once more in twice as many steps, see `IntegrationError`.

    The span has been integrated in `substeps` steps. `plant_at` gives the plant of a state at a
    time.
    """

    program: Program
    tableau: Tableau
    substeps: int
    body: RigidBody
    plant_at: Callable[[Float[Array, ""], PyTree], PlantState]

    def after(
        self,
        error: IntegrationError | None,
        number: Array,
        rate: Callable[[Float[Array, ""], PyTree], PyTree],
        span: Span,
    ) -> IntegrationError | None:
        """The estimate with a span of interval `number`, along which `rate` is the state's.

        A program that estimates every so many intervals counts each of these for all of them.
        """
        every = self.program.error_every
        if error is None:
            return None
        begin, length, first, last = stop_gradient(span)
        steps, end = 2 * self.substeps, begin + length

        def one(number, state):
            step = length / steps
            return explicit_step(self.tableau, rate, begin + number * step, step, state)

        def estimated():
            halved = self.plant_at(end, jax.lax.fori_loop(0, steps, one, first))
            return error.after(self.body, length, self.plant_at(end, last), halved, float(every))

        def carried():
            return error.later(length)

        if every == 1:
            return estimated()
        return jax.lax.cond(number % every == 0, estimated, carried)
