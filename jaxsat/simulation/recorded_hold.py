"""A hold of a sampled loop in equal steps of diffrax, with what is recorded of a run."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.tolerances import SettlingTracker, Tolerances
from jaxsat.simulation.assessment import Observation, effort_rate, stop_gradient
from jaxsat.simulation.held_torque import HeldTorque
from jaxsat.simulation.integration_error import IntegrationError


class SampledRecord(NamedTuple):
    """What is recorded of a sampled run: settled and at rest since when, ∫|T| (N m s), the torques
    of the period, and the error of the steps."""

    settled: SettlingTracker
    rest: SettlingTracker
    integral: Float[Array, " m"]
    held: HeldTorque
    error: IntegrationError

    def at(self, t, observed: Observation, tolerances: Tolerances) -> "SampledRecord":
        """With one more observation."""
        settled = self.settled.observe(t, observed.excess(tolerances))
        rest = self.rest.observe(t, observed.rest_excess(tolerances))
        return self._replace(settled=settled, rest=rest)


def over_hold(loop, solver, t, state, hold, record, tolerances):
    """The plant's state and the record at the end of a hold that begins at time `t` (s)."""

    def observe(record, begin, length, before, after):
        same, held, before, now, length, gone = stop_gradient(
            (loop, hold, before, after, length, begin - t)
        )
        rate = effort_rate(same.plant, begin, before, same.torque(begin, before, held, gone))
        torque = same.torque(begin + length, now, held, gone + length)
        rate = rate + effort_rate(same.plant, begin + length, now, torque)
        record = record.at(begin + length, Observation.of(same.plant, now), tolerances)
        return record._replace(integral=record.integral + length / 2 * rate)

    steps = loop.substeps
    after, record = _equal_steps(loop, solver, t, state, hold, steps, observe, record)
    same, at, begun, held = stop_gradient((loop, t, state, hold))
    halved, _ = _equal_steps(same, solver, at, begun, held, 2 * steps, lambda none, *_: none, ())
    error = record.error.after(loop.plant, hold.length, after, halved)
    first = loop.torque(t, state, hold, jnp.zeros_like(hold.length))
    last = loop.torque(t + hold.length, after, hold, hold.length)
    held = record.held.with_hold(*stop_gradient((hold.length, first, last)))
    return after, record._replace(held=held, error=error)


def _equal_steps(loop, solver, t, state, hold, count: int, observe, record):
    """The plant's state after so many equal steps through a hold, and what was observed of each."""
    import diffrax

    term = diffrax.ODETerm(lambda now, state, hold: loop.plant_rate(now, state, hold, now - t))
    step = hold.length / count
    solver_state = solver.init(term, t, t + step, state, hold)

    def one(number, carry):
        before, inner, record = carry
        begin = t + number * step
        after, _, _, inner, _ = solver.step(
            term, begin, begin + step, before, hold, inner, made_jump=False
        )
        return after, inner, observe(record, begin, step, before, after)

    after, _, record = jax.lax.fori_loop(0, count, one, (state, solver_state, record))
    return after, record
