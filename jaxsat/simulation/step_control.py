"""diffrax's choice of steps, with the momenta of wheels judged in a unit of the body's own."""

import diffrax

from jaxsat.simulation.units import in_units, out_of_units
from jaxsat.spacecraft.dynamics import RigidBody


class StepControl(diffrax.PIDController):
    """A `PIDController` of a loop's state whose momenta are in units of the `body`."""

    body: RigidBody | None = None

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        """With the first step of the state in units."""

        def rate(terms, t, y, args):
            return self._of(in_units, func(terms, t, self._of(out_of_units, y), args))

        return super().init(terms, t0, t1, self._of(in_units, y0), dt0, args, rate, error_order)

    def adapt_step_size(
        self, t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
    ):
        """By states and error in units."""
        before, after, error = (self._of(in_units, y) for y in (y0, y1_candidate, y_error))
        return super().adapt_step_size(
            t0, t1, before, after, args, error, error_order, controller_state
        )

    def _of(self, change, state):
        return state if self.body is None else change(self.body, state)
