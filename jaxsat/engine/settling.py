"""Since when a trajectory of adaptive steps is settled, judged on their dense output."""

from itertools import pairwise

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.engine.flat_ode import DenseStep, FlatODE
from jaxsat.engine.root_finding import Bracket, find_root
from jaxsat.metrics import SettlingTracker
from jaxsat.simulation.assessment import Observation, stop_gradient


def settled_along_step(
    ode: FlatODE, step: DenseStep, until: Float[Array, ""], settled: SettlingTracker
) -> SettlingTracker:
    """Since when the case is settled, with the fraction `until` of a step taken into account.

    It is observed at the ends of equal parts, as many as for events, and the instant at which it
    comes inside the tolerances is located between them. Nothing of it is differentiated.
    """
    ode, step, until = stop_gradient((ode, step, until))
    tolerances = ode.program.tolerances

    def excess(fraction):
        t = step.begin + fraction * step.length
        plant = ode.loop.plant_state(t, ode.state(t, ode.interpolated(step, fraction)))
        return Observation.of(ode.loop.plant, plant).excess(tolerances)

    count = ode.output.event_checks
    points = [until * number / count for number in range(1, count + 1)]
    values = [excess(point) for point in points]
    depths = [-jnp.max(value) for value in (settled.excess, *values)]  # positive inside
    ends = list(zip([jnp.zeros_like(until), *points], depths, strict=True))
    bracket = Bracket(*ends[0], *ends[0])
    enters = jnp.zeros_like(until) > 0
    for low, high in pairwise(ends):
        here = (low[1] <= 0) & (high[1] > 0)
        now = Bracket(*low, *high)
        bracket = Bracket(*(jnp.where(here, x, y) for x, y in zip(now, bracket, strict=True)))
        enters |= here
    end = step.begin + until * step.length
    inside = depths[-1] > 0
    root = find_root(lambda fraction: -jnp.max(excess(fraction)), bracket, enters & inside)
    entry = jnp.where(enters, step.begin + root * step.length, step.begin)
    before = settled._replace(start=jnp.where(enters, jnp.inf, settled.start))
    return before.observe_after_entry(entry, end, values[-1])
