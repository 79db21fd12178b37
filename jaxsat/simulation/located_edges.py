"""Holds divided where a wheel with a rotor inertia comes to rest or its limit, or leaves it.

When that happens depends on how the body turns. So a hold is integrated to its end, and where a
wheel has left the state that it was in (`jaxsat.spacecraft.wheel_states`) the instant is searched
by false position (the Illinois rule), each time integrated from the last such instant on.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.core.trees import choose
from jaxsat.spacecraft import Hold, Wheels, WheelStates
from jaxsat.spacecraft.dynamics import PlantState, RigidBody

RealScalar = Float[Array, ""]
Integrate = Callable[[RealScalar, Hold, PlantState, PyTree], tuple[PlantState, PyTree]]

RESOLUTION = 1e-13
"""Of a hold: how well instants are located in it."""

TRIES = 12
"""Integrations for each part of a hold, at most on the average."""

SLOW = 8
"""After so many tries to locate an instant every other one halves the bracket."""


class _Bracket(NamedTuple):
    """Where an instant is searched, in s from the begin of the hold, and the least margins there.

    `open` tells whether there is one, `side` at which end (-1 or 1) the last try came to lie. After
    `tries` the bracket may be `closed`: `correction` (s) is zero, and has the derivative of the
    instant.
    """

    low: RealScalar
    high: RealScalar
    at_low: RealScalar
    at_high: RealScalar
    side: RealScalar
    tries: Int[Array, ""]
    correction: RealScalar
    open: Bool[Array, ""]
    closed: Bool[Array, ""]

    def following(self, x: RealScalar, margin: RealScalar, correction: RealScalar, tolerance):
        """After a try at x, to be closed where that is within twice the tolerance."""
        left = margin < 0
        again = jnp.where(left, 1.0, -1.0) == self.side  # the Illinois rule
        at_low = jnp.where(left & again, self.at_low / 2, self.at_low)
        at_high = jnp.where(~left & again, self.at_high / 2, self.at_high)
        low, high = jnp.where(left, self.low, x), jnp.where(left, x, self.high)
        return _Bracket(
            low,
            high,
            jnp.where(left, at_low, margin),
            jnp.where(left, margin, at_high),
            jnp.where(left, 1.0, -1.0),
            self.tries + 1,
            jnp.where(left, correction, self.correction),
            jnp.array(True),
            high - low <= 2 * tolerance,
        )

    def next_try(self, end: RealScalar, tolerance: RealScalar) -> RealScalar:
        """Where to integrate to: the `end` of the hold without a bracket."""
        slope = self.at_high - self.at_low
        share = self.at_low / jnp.where(slope < 0, -slope, 1.0)
        halves = (self.tries > SLOW) & (self.tries % 2 == 0)
        share = jnp.where(halves | (slope >= 0), 0.5, share)
        x = self.low + share * (self.high - self.low)
        x = jnp.clip(x, self.low + tolerance, self.high - tolerance)
        x = jnp.where(self.closed, self.high, x)
        return jnp.where(self.open, jax.lax.stop_gradient(x) + self.correction, end)


class _Search(NamedTuple):
    """How far a hold has come: an instant (s from its begin), all there, and what is searched."""

    begin: RealScalar
    plant: PlantState
    carry: PyTree
    states: WheelStates
    bracket: _Bracket


def external_torque(
    body: RigidBody, t: RealScalar, plant: PlantState, hold: Hold, elapsed: RealScalar
) -> Float[Array, "3"]:
    """The torque of thrusters and magnetorquers `elapsed` seconds after a hold began, N m."""
    torque = hold.torque_after(elapsed)
    if hold.dipole is None:
        return torque
    return torque + body.magnetic_torque(t, plant, hold.dipole)


def through_located_parts(
    body: RigidBody,
    wheels: Wheels,
    command: Float[Array, " wheels"],
    t: RealScalar,
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `wheels` are those of the `body` in the condition that they are in, which does not change. The
    hold is integrated at most `TRIES` (1 + `wheels.edge_count`) times, the last time to its end.
    """
    drive, end = wheels.motor_torque(command), hold.length
    tolerance, rounds = RESOLUTION * end, TRIES * (1 + wheels.edge_count)

    def others(elapsed, plant):
        at = t + elapsed
        torque = external_torque(body, at, plant, hold, elapsed)
        return torque + body.disturbance_torque(at, plant)

    def judged(elapsed, plant, states: WheelStates):
        """Margins of all wheels at an instant, the drag, and the rates of their momenta."""
        piece, external = states.piece(wheels, drive), others(elapsed, plant)
        drag = body.wheel_drag(plant, external, piece)
        rate = jnp.where(states.turns, -piece.torque(plant.wheel_momentum) - drag, 0.0)
        return states.margins(wheels, plant.wheel_momentum, drive, drag), drag, rate

    def begun(elapsed, plant, carry, states: WheelStates) -> _Search:
        states = body.wheel_states(wheels, plant, drive, others(elapsed, plant), states)
        least = jnp.min(judged(elapsed, plant, states)[0])
        zero, no = jnp.zeros_like(end), jnp.array(False)
        bracket = _Bracket(elapsed, end, least, least, zero, jnp.array(0), zero, no, no)
        return _Search(elapsed, plant, carry, states, jax.lax.stop_gradient(bracket))

    def part(number, now: _Search) -> _Search:
        last, bracket = number == rounds - 1, now.bracket
        x = jnp.where(last, end, bracket.next_try(end, tolerance))
        one = hold.part(now.begin, x - now.begin)
        one = one._replace(wheels=now.states.piece(wheels, drive))
        plant, carry = integrate(t + now.begin, one, now.plant, now.carry)
        margins, drag, rate = judged(x, plant, now.states)
        least = jnp.min(margins)
        correction = _correction(margins, plant.wheel_momentum, rate, now.states)
        known = jax.lax.stop_gradient((bracket, x, least))
        tried = known[0].following(*known[1:], correction, jax.lax.stop_gradient(tolerance))
        there = last | bracket.closed | (~bracket.open & (least >= 0))
        left = now.states.left(margins, drive, drag)
        come = jnp.where(bracket.closed, margins, jnp.inf)
        momentum = now.states.snapped(wheels, cast(Array, plant.wheel_momentum), come)
        plant = PlantState(plant.attitude, plant.omega, momentum)
        return choose(there, begun(x, plant, carry, left), now._replace(bracket=tried))

    def one(number, now: _Search) -> _Search:
        return jax.lax.cond(now.begin < end, lambda x: part(number, x), lambda x: x, now)

    from_momenta = body.wheel_states(wheels, plant, drive, others(jnp.zeros_like(end), plant))
    first = begun(jnp.zeros_like(end), plant, carry, from_momenta)
    found = jax.lax.fori_loop(0, rounds, one, first)
    return found.plant, found.carry


def _correction(margins, momentum, rate, states: WheelStates) -> RealScalar:
    """Zero (s), with the derivative of the instant at which the least margin of all is zero.

    That at which a wheel breaks loose needs none: nothing jumps there.
    """
    speeds = jnp.stack([states.side * rate, -jnp.sign(momentum) * rate])
    decides = (margins == jnp.min(margins)) & states.turns[None] & (speeds != 0)
    speeds = jax.lax.stop_gradient(jnp.where(decides, speeds, 1.0))
    finite = jnp.where(decides, margins, 0.0)
    return -jnp.sum((finite - jax.lax.stop_gradient(finite)) / speeds)
