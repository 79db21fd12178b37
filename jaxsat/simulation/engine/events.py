"""Where a step meets an event of its loop, with derivatives that move the instant."""

from itertools import pairwise
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.simulation.assessment import stop_gradient
from jaxsat.simulation.engine.flat_ode import DenseStep, FlatODE
from jaxsat.simulation.engine.root_finding import Bracket, find_root


class StepEnd(NamedTuple):
    """Where a step ends: its length (s), flat state with its rate, and the event functions with
    their signs there."""

    length: Float[Array, ""]
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
    needed: Bool[Array, ""],
    min_step: Float[Array, ""],
) -> StepEnd:
    """The end of a `step` that would go to `end`, its event functions being `events` at its begin.

    It is at the first event, though at least `min_step` (s) away, or at the end of the step. A
    step for which it is not `needed` costs no search.
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
    crosses = needed & (bracket.high_value > 0)

    def at_event():
        fraction = stop_gradient(find_root(beyond, bracket, crosses))
        one_hot = jnp.arange(sign.size) == jnp.argmax(sign * events_at(fraction))
        length = _corrected(ode, signs, step, one_hot, fraction)
        length = jnp.clip(length, jnp.minimum(min_step, whole), whole)
        t, state = step.begin + length, ode.interpolated(step, length / whole)
        flipped = signs ^ one_hot
        there = ode.events(flipped, t, state)
        # what jumps with the piece may have another sign there
        now = jnp.where(one_hot, flipped, there > 0)
        return StepEnd(length, state, ode.rate(now)(t, state), now, there)

    return ode.cold_branch(crosses, at_event, end)


def _bracket(sign, at_begin, at_end, beyond, checks: int) -> Bracket:
    """The first of equal parts of a step that meets an event, if its `high_value` is positive;
    else the last one."""
    begin, end = jnp.max(sign * at_begin), jnp.max(sign * at_end)
    points = [jnp.full_like(begin, number / checks) for number in range(checks + 1)]
    values = [begin, *map(beyond, points[1:-1]), end]
    ends = list(zip(points, values, strict=True))
    *earlier, found = (Bracket(*low, *high) for low, high in pairwise(ends))
    for bracket in reversed(earlier):
        meets = bracket.high_value > 0
        found = Bracket(*(jnp.where(meets, a, b) for a, b in zip(bracket, found, strict=True)))
    return found


def _corrected(ode: FlatODE, signs, step: DenseStep, one_hot, fraction) -> Float[Array, ""]:
    """The seconds until the event: two steps of Newton's method.

    The second one moves with parameters. Taken where the function is zero, it is exact to first
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
