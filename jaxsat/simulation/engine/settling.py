"""Since when a trajectory of adaptive steps is settled, judged on their dense output."""

import math
from collections.abc import Callable
from itertools import pairwise

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.assessment import Observation, stop_gradient
from jaxsat.simulation.engine.flat_ode import DenseStep, FlatODE
from jaxsat.simulation.engine.root_finding import Bracket, find_root

BETWEEN = math.sqrt(2)
"""How far an oscillation may go between instants a quarter of its period apart, in parts of the
largest of them."""


def excess_at(
    ode: FlatODE, t: Float[Array, ""], flat: Float[Array, " n"]
) -> Float[Array, "conditions"]:
    """How far outside the tolerances a flat state is at time `t` (s); nothing is differentiated."""
    return _observation_at(ode, t, flat).excess(ode.program.tolerances)


def rest_excess_at(
    ode: FlatODE, t: Float[Array, ""], flat: Float[Array, " n"]
) -> Float[Array, "1"]:
    """The same of the inertial rate alone."""
    return _observation_at(ode, t, flat).rest_excess(ode.program.tolerances)


def _observation_at(ode: FlatODE, t: Float[Array, ""], flat: Float[Array, " n"]) -> Observation:
    ode, t, flat = stop_gradient((ode, t, flat))
    return Observation.of(ode.loop.plant, ode.loop.plant_state(t, ode.state(t, flat)))


def settled_along_step(
    ode: FlatODE,
    step: DenseStep,
    until: Float[Array, ""],
    settled: SettlingTracker,
    at_end: Float[Array, "conditions"],
    needed: Bool[Array, ""],
    excess_of: Callable | None = None,
) -> SettlingTracker:
    """Since when the case is settled, with the fraction `until` of a step taken into account.

    `at_end` is the excess there. If it is outside the tolerances, nothing else matters. Neither
    does it if begin, middle and end are further inside than they differ, by `BETWEEN`. In other
    steps the excess is observed at the ends of equal parts, as many as for events, and the instant
    at which the case comes inside is located between them. Nothing of it is differentiated. A step
    for which it is not `needed` costs no search. `excess_of` tells the excess of a flat state,
    `excess_at` unless given.
    """
    ode, step, until, at_end = stop_gradient((ode, step, until, at_end))
    end = step.begin + until * step.length

    def excess(fraction):
        t = step.begin + fraction * step.length
        return (excess_of or excess_at)(ode, t, ode.interpolated(step, fraction))

    middle = until / 2
    at_middle = excess(middle)
    known = jnp.stack([settled.excess, at_middle, at_end])
    most = jnp.max(known, axis=0)
    differ = most - jnp.min(known, axis=0)
    stays = jnp.all(BETWEEN * (1 + most) + differ < 1)

    def entered() -> SettlingTracker:
        count = ode.output.event_checks
        points = [until * number / count for number in range(1, count + 1)]
        between = [
            at_middle if 2 * number == count else excess(points[number - 1])
            for number in range(1, count)
        ]
        depths = [
            -jnp.max(value) for value in (settled.excess, *between, at_end)
        ]  # positive inside
        ends = list(zip([jnp.zeros_like(until), *points], depths, strict=True))
        bracket = Bracket(*ends[0], *ends[0])
        enters = jnp.zeros_like(until) > 0
        for low, high in pairwise(ends):
            here = (low[1] <= 0) & (high[1] > 0)
            now = Bracket(*low, *high)
            bracket = Bracket(*(jnp.where(here, x, y) for x, y in zip(now, bracket, strict=True)))
            enters |= here
        root = find_root(lambda fraction: -jnp.max(excess(fraction)), bracket, enters)
        entry = jnp.where(enters, step.begin + root * step.length, step.begin)
        before = settled._replace(start=jnp.where(enters, jnp.inf, settled.start))
        return before.observe_after_entry(entry, end, at_end)

    unchanged = settled.observe_after_entry(step.begin, end, at_end)
    searched = needed & jnp.all(at_end < 0) & ~stays
    return ode.cold_branch(searched, entered, unchanged)
