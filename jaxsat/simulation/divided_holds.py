"""Holds of a sampled loop, divided at failures and where an effector reaches an edge or changes its
mode: a wheel stops, starts, or reaches its momentum limit.

The instant of a mode change depends on the body's rotation. A hold is therefore integrated to its
end; if an effector has left its mode by then, false position (the Illinois rule) locates the
instant, each trial integrated from the last located instant.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import OfEach, PlantState, RigidBody
from jaxsat.spacecraft.held_effector import Hold

Integrate = Callable[[RealScalar, Hold, PlantState, PyTree], tuple[PlantState, PyTree]]

RESOLUTION = 1e-13
"""Tolerance on located instants, relative to the length of the hold."""

TRIES = 12
"""Largest average number of integrations per part of a hold."""

SLOW = 8
"""Number of trials for an instant after which every other one halves the bracket."""


class _Bracket(NamedTuple):
    """Bracket of an instant, in s from the begin of the hold, and the smallest margins at its ends.

    `open` is true if there is a bracket; `side` (-1 or 1) is the end that the last trial replaced.
    After `tries` the bracket may be `closed`: `correction` (s) is zero, with the derivative of the
    instant.
    """

    low: RealScalar
    high: RealScalar
    at_low: RealScalar
    at_high: RealScalar
    side: RealScalar
    tries: IntScalar
    correction: RealScalar
    open: BoolScalar
    closed: BoolScalar

    def following(self, x: RealScalar, margin: RealScalar, correction: RealScalar, tolerance):
        """The bracket after a trial at x, `closed` once no wider than twice the tolerance."""
        outside = margin < 0
        again = jnp.where(outside, 1.0, -1.0) == self.side  # the Illinois rule
        at_low = jnp.where(outside & again, self.at_low / 2, self.at_low)
        at_high = jnp.where(~outside & again, self.at_high / 2, self.at_high)
        low, high = jnp.where(outside, self.low, x), jnp.where(outside, x, self.high)
        return _Bracket(
            low,
            high,
            jnp.where(outside, at_low, margin),
            jnp.where(outside, margin, at_high),
            jnp.where(outside, 1.0, -1.0),
            self.tries + 1,
            jnp.where(outside, correction, self.correction),
            jnp.array(True),
            high - low <= 2 * tolerance,
        )

    def next_try(self, end: RealScalar, tolerance: RealScalar) -> RealScalar:
        """The end of the next integration: the `end` of the hold without a bracket."""
        slope = self.at_high - self.at_low
        share = self.at_low / jnp.where(slope < 0, -slope, 1.0)
        halves = (self.tries > SLOW) & (self.tries % 2 == 0)
        share = jnp.where(halves | (slope >= 0), 0.5, share)
        x = self.low + share * (self.high - self.low)
        x = jnp.clip(x, self.low + tolerance, self.high - tolerance)
        x = jnp.where(self.closed, self.high, x)
        return jnp.where(self.open, jax.lax.stop_gradient(x) + self.correction, end)


class _HoldSearch(NamedTuple):
    """Progress through a hold: an instant (s from its begin), the state there, and the bracket."""

    begin: RealScalar
    plant: PlantState
    carry: PyTree
    modes: OfEach
    bracket: _Bracket


class _Judgement(NamedTuple):
    """Margins by effector and concatenated, d/dt of margins before a jump, and dω/dt."""

    margins: OfEach
    flat: Float[Array, " m"]
    speeds: Float[Array, " m"]
    acceleration: Vector


def through_located_parts(
    body: RigidBody,
    commands: OfEach,
    t: RealScalar,
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    The effectors of the `body` have no further failures. Each edge of the hold takes at most
    `TRIES` integrations; a last one goes to its end.
    """
    end = hold.length
    edges = sum(one.edge_count for one in body.effectors)
    tolerance, rounds = RESOLUTION * end, TRIES * (1 + edges)

    def judge(elapsed, plant: PlantState, modes: OfEach) -> _Judgement:
        pieces = body.later(body.pieces(modes, commands), elapsed)
        acceleration = body.acceleration(t + elapsed, plant, pieces=pieces)
        parts = list(zip(body.effectors, modes, plant.of_each, commands, strict=True))
        margins = tuple(one.margins(m, s, c, acceleration) for one, m, s, c in parts)
        speeds = tuple(one.approach(m, s, c, acceleration) for one, m, s, c in parts)
        return _Judgement(margins, _flat(margins), _flat(speeds), acceleration)

    def begin(elapsed, plant, carry, modes: OfEach) -> _HoldSearch:
        modes = body.modes(t + elapsed, plant, body.later(commands, elapsed), modes)
        least = jnp.min(judge(elapsed, plant, modes).flat)
        zero, no = jnp.zeros_like(end), jnp.array(False)
        bracket = _Bracket(elapsed, end, least, least, zero, jnp.array(0), zero, no, no)
        return _HoldSearch(elapsed, plant, carry, modes, jax.lax.stop_gradient(bracket))

    def part(number, now: _HoldSearch) -> _HoldSearch:
        last, bracket = number == rounds - 1, now.bracket
        x = jnp.where(last, end, bracket.next_try(end, tolerance))
        one = hold.part(now.begin, x - now.begin)
        one = one._replace(pieces=body.later(body.pieces(now.modes, commands), now.begin))
        plant, carry = integrate(t + now.begin, one, now.plant, now.carry)
        judgement = judge(x, plant, now.modes)
        least = jnp.min(judgement.flat)
        still, place, margin = jax.lax.stop_gradient((bracket, x, least))
        correction = _correction(judgement.flat, judgement.speeds)
        narrower = still.following(place, margin, correction, jax.lax.stop_gradient(tolerance))
        there = last | bracket.closed | (~bracket.open & (least >= 0))
        modes = body.modes_after(now.modes, plant, commands, judgement.acceleration)
        parts = zip(body.effectors, now.modes, plant.of_each, judgement.margins, strict=True)
        states = tuple(
            one.come(mode, own, jnp.where(bracket.closed, margins, jnp.inf))
            for one, mode, own, margins in parts
        )
        plant = PlantState(plant.attitude, plant.omega, states)
        return choose(there, begin(x, plant, carry, modes), now._replace(bracket=narrower))

    def one(number, now: _HoldSearch) -> _HoldSearch:
        return jax.lax.cond(now.begin < end, lambda x: part(number, x), lambda x: x, now)

    zero = jnp.zeros_like(end)
    modes = body.modes(t, plant, commands)
    search = jax.lax.fori_loop(0, rounds, one, begin(zero, plant, carry, modes))
    return search.plant, search.carry


def _flat(parts: OfEach) -> Float[Array, " margins"]:
    return jnp.concatenate([one.ravel() for one in parts])


def _correction(margins: Float[Array, " m"], speeds: Float[Array, " m"]) -> RealScalar:
    """Zero (s), with the derivative of the instant at which the smallest margin of all is zero.

    A margin of zero speed has no correction, as nothing jumps there.
    """
    decides = (margins == jnp.min(margins)) & (speeds != 0)
    speeds = jax.lax.stop_gradient(jnp.where(decides, speeds, 1.0))
    finite = jnp.where(decides, margins, 0.0)
    return -jnp.sum((finite - jax.lax.stop_gradient(finite)) / speeds)


def through_hold(
    body: RigidBody,
    commands: OfEach,
    t: RealScalar,
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `integrate` covers each part without a failure or a mode change of an effector of the `body`.
    """
    times = [one - t for one in body.failure_times]  # from the begin of the hold
    at = jnp.concatenate([*times, jnp.zeros(0)])

    def through(elapsed, t, hold, plant, carry):
        struck = tuple(one <= elapsed for one in times)
        plant = body.after_failures(plant, struck)
        working_body, now = body.driven(plant, body.later(commands, elapsed), struck)
        return _between_failures(working_body, now, t, hold, plant, integrate, carry)

    if not at.size:
        return through(jnp.zeros_like(t), t, hold, plant, carry)

    def part(now):
        begin, plant, carry = now
        end = jnp.minimum(jnp.min(jnp.where(at > begin, at, hold.length)), hold.length)
        one = hold.part(begin, end - begin)
        return end, *through(begin, t + begin, one, plant, carry)

    def one(_, now):
        return jax.lax.cond(now[0] < hold.length, part, lambda now: now, now)

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, at.size + 1, one, first)[1:]


def _between_failures(
    body: RigidBody,
    commands: OfEach,
    t: RealScalar,
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold without failures.

    Edges that do not depend on the body's rotation are closed forms of the initial state.
    """
    if any(one.follows_body for one in body.effectors):
        return through_located_parts(body, commands, t, hold, plant, integrate, carry)
    parts = list(zip(body.effectors, plant.of_each, commands, strict=True))

    def pieces(begin, elapsed):
        each = [one.held_piece(own, command, elapsed) for one, own, command in parts]
        return body.later(tuple(each), begin)

    count = sum(one.edge_count for one in body.effectors)
    if not count:
        each = pieces(jnp.zeros_like(hold.length), hold.length)
        return integrate(t, hold._replace(pieces=each), plant, carry)
    edges = jnp.concatenate([one.edges(own, command, hold.length) for one, own, command in parts])

    def part(now):
        begin, plant, carry = now
        end = jnp.min(jnp.where(edges > begin, edges, hold.length))
        one = hold.part(begin, end - begin)._replace(pieces=pieces(begin, (begin + end) / 2))
        plant, carry = integrate(t + begin, one, plant, carry)
        states = tuple(
            one.snapped(own, command, end, now)
            for (one, own, command), now in zip(parts, plant.of_each, strict=True)
        )
        return end, PlantState(plant.attitude, plant.omega, states), carry

    def one(number, now):  # derivatives by the length of a hold need a part also if that is zero
        ahead = (number == 0) | (now[0] < hold.length)
        return jax.lax.cond(ahead, part, lambda now: now, now)

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, count + 1, one, first)[1:]
