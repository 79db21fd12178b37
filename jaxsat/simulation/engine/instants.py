"""Instants within an adaptive step: events and settling.

The instant of an event is differentiated; that of settling is not.
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.assessment import JudgedSignals, stop_gradient
from jaxsat.simulation.engine.flat_ode import DenseStep, FlatODE
from jaxsat.simulation.engine.root_finding import Bracket, find_root


class StepEnd(NamedTuple):
    """End of a step: its length (s), flat state with its rate, and the event functions with their
    signs."""

    length: RealScalar
    state: Float[Array, " n"]
    rate: Float[Array, " n"]
    signs: Bool[Array, " m"]
    events: Float[Array, " m"]


def until_event(
    ode: FlatODE,
    signs: Bool[Array, " m"],
    events: Float[Array, " m"],
    step: DenseStep,
    end: StepEnd,
    active: BoolScalar,
    min_step: RealScalar,
) -> StepEnd:
    """The end of a `step` that would go to `end`, from `events`, the event functions at its begin.

    The end is at the first event, though at least `min_step` (s) away, or at the end of the step. A
    step that is not `active` costs no search.
    """
    whole = step.length
    if not signs.size:
        return end
    sign = jnp.where(signs, -1.0, 1.0)

    constant = stop_gradient((ode, step))

    def events_at(fraction):
        ode, step = constant
        return ode.events(signs, step.begin + fraction * whole, ode.interpolated(step, fraction))

    def beyond(fraction):  # positive beyond an event
        return jnp.max(sign * events_at(fraction))

    end = end._replace(events=ode.events(signs, step.begin + whole, end.state))
    ends = (stop_gradient(events), stop_gradient(end.events))
    bracket = _bracket(sign, *ends, beyond, ode.output.event_checks)
    crosses = active & (bracket.high_value > 0)

    def at_event():
        fraction = stop_gradient(find_root(beyond, bracket, crosses))
        one_hot = jnp.arange(sign.size) == jnp.argmax(sign * events_at(fraction))
        length = _correct(ode, signs, step, one_hot, fraction)
        length = jnp.clip(length, jnp.minimum(min_step, whole), whole)
        t, state = step.begin + length, ode.interpolated(step, length / whole)
        flipped = signs ^ one_hot
        values = ode.events(flipped, t, state)
        # a function that jumps with the piece may change its sign
        now = jnp.where(one_hot, flipped, values > 0)
        return StepEnd(length, state, ode.rate(now)(t, state), now, values)

    return ode.cold_branch(crosses, at_event, end)


def _bracket(sign, at_begin, at_end, beyond, checks: int) -> Bracket:
    """The first of equal parts of a step that contains an event, if its `high_value` is positive;
    else the last one."""
    begin, end = jnp.max(sign * at_begin), jnp.max(sign * at_end)
    points = [jnp.full_like(begin, number / checks) for number in range(checks + 1)]
    values = [begin, *map(beyond, points[1:-1]), end]
    ends = list(zip(points, values, strict=True))
    *earlier, bracket = (Bracket(*low, *high) for low, high in pairwise(ends))
    for part in reversed(earlier):
        meets = part.high_value > 0
        bracket = Bracket(*(jnp.where(meets, a, b) for a, b in zip(part, bracket, strict=True)))
    return bracket


def _correct(ode: FlatODE, signs, step: DenseStep, one_hot, fraction) -> RealScalar:
    """The seconds until the event: two steps of Newton's method.

    The second is differentiated. Taken where the function is zero, its derivative is exact to first
    order.
    """

    def event(length):
        events = ode.events(
            signs, step.begin + length, ode.interpolated(step, length / step.length)
        )
        return jnp.sum(jnp.where(one_hot, events, 0.0))

    def improved(length):
        value, slope = jax.jvp(event, (length,), (jnp.ones_like(length),))
        slope = stop_gradient(slope)
        correction = -value / jnp.where(slope == 0, 1.0, slope)
        sound = (slope != 0) & (jnp.abs(correction) < 1e-2 * step.length)
        return jnp.where(sound, length + correction, length)

    return improved(stop_gradient(improved(fraction * step.length)))


BETWEEN = math.sqrt(2)
"""Largest excursion of an oscillation between instants a quarter period apart, relative to the
largest of them."""


def excess_at(ode: FlatODE, t: RealScalar, flat: Float[Array, " n"]) -> Float[Array, " conditions"]:
    """Excess over the tolerances of a flat state at time `t` (s); nothing is differentiated."""
    return _observation_at(ode, t, flat).excess(ode.program.tolerances)


def rest_excess_at(ode: FlatODE, t: RealScalar, flat: Float[Array, " n"]) -> Float[Array, "1"]:
    """Excess over its tolerance of the inertial rate of a flat state at time `t` (s)."""
    return _observation_at(ode, t, flat).rest_excess(ode.program.tolerances)


def _observation_at(ode: FlatODE, t: RealScalar, flat: Float[Array, " n"]) -> JudgedSignals:
    ode, t, flat = stop_gradient((ode, t, flat))
    return JudgedSignals.of(ode.loop.plant, ode.loop.plant_state(t, ode.state(t, flat)))


def settled_along_step(
    ode: FlatODE,
    step: DenseStep,
    until: RealScalar,
    tracker: SettlingTracker,
    at_end: Float[Array, " conditions"],
    active: BoolScalar,
    excess_of: Callable | None = None,
) -> SettlingTracker:
    """The settling tracker after the fraction `until` of a step.

    `at_end` is the excess there. A step that ends outside the tolerances needs no search, nor does
    one whose begin, middle and end are further inside than they differ, by `BETWEEN`. In other
    steps the excess is observed at the ends of equal parts, as many as for events, and the instant
    of entry is located between them. Nothing is differentiated. A step that is not `active` costs
    no search. `excess_of` gives the excess of a flat state, by default `excess_at`.
    """
    ode, step, until, at_end = stop_gradient((ode, step, until, at_end))
    end = step.begin + until * step.length

    def excess(fraction):
        t = step.begin + fraction * step.length
        return (excess_of or excess_at)(ode, t, ode.interpolated(step, fraction))

    middle = until / 2
    at_middle = excess(middle)
    excesses = jnp.stack([tracker.excess, at_middle, at_end])
    most = jnp.max(excesses, axis=0)
    differ = most - jnp.min(excesses, axis=0)
    stays = jnp.all(BETWEEN * (1 + most) + differ < 1)

    def entered() -> SettlingTracker:
        count = ode.output.event_checks
        points = [until * number / count for number in range(1, count + 1)]
        between = [
            at_middle if 2 * number == count else excess(points[number - 1])
            for number in range(1, count)
        ]
        depths = [
            -jnp.max(value) for value in (tracker.excess, *between, at_end)
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
        before = tracker._replace(start=jnp.where(enters, jnp.inf, tracker.start))
        return before.observe_after_entry(entry, end, at_end)

    unchanged = tracker.observe_after_entry(step.begin, end, at_end)
    searched = active & jnp.all(at_end < 0) & ~stays
    return ode.cold_branch(searched, entered, unchanged)
