"""Hand-over between the large oscillation and the end game, and coasting in the end game.

The end game coasts against a drift beyond the reach of its oscillation. The rest of such a drift,
d, moves the slow turn along a parabola. A hold that begins with the slow rate √(2 |d| A) against
the drift first turns by A the other way, and stays within its limits for about twice as long as one
that begins at rest.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxsat.control.normal_form import Tilt
from jaxsat.control.oscillatory import Slow
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.checks import as_optional_float, positive

AIMED_TURN = 0.02
"""Default of A, rad; the settling tolerance of a turn about the body's third axis is 0.05 rad."""

NEAR_AIM, ENOUGH = 0.85, 0.75
"""Smallest duration of a hold relative to one that begins as aimed, to begin it and to keep it."""

KNOWN_PERIODS = 10
"""Age of the first hold when it is judged, in periods of the oscillation: the drift is then
known."""

TINY, LEAST_PART = 1e-30, 1e-3
"""Added under a root so that its derivative is finite, and the least part of an axis to divide by.
"""


class HoldRecord(NamedTuple):
    """Begin of the present hold (s), and whether any has lasted until the drift was known.

    Without a hold `begin` is the present time: only a hold has an age, as the drift is estimated
    while the other rates are small.
    """

    begin: RealScalar
    known: BoolScalar

    @staticmethod
    def none(omega: Vector) -> "HoldRecord":
        """The state before the first hold."""
        return HoldRecord(jnp.zeros_like(omega[0]), jnp.array(False))

    def after(self, holds: BoolScalar, clock: RealScalar, coast: "UnbalancedDrift") -> "HoldRecord":
        """The record at a `clock` (s), by whether the end game `holds` and whether `coast`
        judges."""
        return HoldRecord(jnp.where(holds, self.begin, clock), self.known | coast.judged)


class UnbalancedDrift(NamedTuple):
    """The part of the drift that the end game cannot balance, and whether to judge a hold now.

    The end game balances a drift up to `sure`; the rest, `drift` (rad/s²), is zero for a smaller
    one, and until the drift is known. `aim_turn` is A (rad).
    """

    drift: RealScalar
    sure: RealScalar
    judged: BoolScalar
    aim_turn: RealScalar | float

    @staticmethod
    def of(
        hold: HoldRecord,
        clock: RealScalar,
        frequency: RealScalar,
        drift: RealScalar,
        sure: RealScalar,
        aim_turn: RealScalar | float = AIMED_TURN,
    ) -> "UnbalancedDrift":
        """The coast for a `drift` (rad/s²) of which `sure` is balanced.

        `frequency` (rad/s) is that of the oscillation, `clock` in s.
        """
        old = (clock - hold.begin) * frequency > KNOWN_PERIODS * 2 * jnp.pi
        beyond = jnp.where(hold.known | old, drift - jnp.clip(drift, -sure, sure), 0.0)
        return UnbalancedDrift(beyond, sure, old & ~hold.known, aim_turn)

    @property
    def drifts(self) -> BoolScalar:
        """Whether the unbalanced drift is nonzero."""
        return self.drift != 0

    def aim(self, turn: RealScalar) -> RealScalar:
        """The slow rate (rad/s) with which a hold should begin at a `turn` (rad)."""
        way = jnp.maximum(self.aim_turn + jnp.sign(self.drift) * turn, 0.0)
        return -jnp.sign(self.drift) * jnp.sqrt(2 * jnp.abs(self.drift) * way + TINY)

    def lasts(
        self, slow: Slow, limit: RealScalar, share: float, slack: RealScalar | None = None
    ) -> BoolScalar:
        """Whether a hold lasts for `share` of the time of one that begins here as aimed.

        It ends where the turn exceeds the `limit` (rad). One that turns beyond it against the drift
        does not last. One that begins within `slack` (rad/s) of the aimed rate is long enough.
        """
        side, size = jnp.sign(self.drift), jnp.abs(self.drift)
        way = jnp.maximum(limit - side * slow.turn, 0.0)
        back = jnp.maximum(limit + side * slow.turn, 0.0)

        def time(rate):  # multiplied by the drift
            return jnp.sqrt(rate**2 + 2 * size * way + TINY) - rate

        stops = -side * slow.rate < jnp.sqrt(2 * (size + self.sure) * back + TINY)
        aim = self.aim(slow.turn)
        long = time(side * slow.rate) >= share * time(side * aim)
        if slack is not None:
            long = long | (jnp.abs(slow.rate - aim) < slack)
        return ~self.drifts | (stops & long)

    def deceleration(self, own: RealScalar) -> RealScalar:
        """Deceleration (rad/s²) of the slow rate at the begin of a hold, `own` without drift."""
        return jnp.where(self.drifts, jnp.abs(self.drift) + 2 * self.sure, own)

    def opposed(self, slow: Slow, turn: RealScalar | float) -> Slow:
        """Input of the end game for a hold against the drift.

        The input is a `turn` (rad) that demands full amplitude, and the excess of the slow rate
        over the aimed one, as a hold that begins too fast must not turn too far.
        """
        side = jnp.sign(self.drift)
        excess = jnp.minimum(side * (slow.rate - self.aim(slow.turn)), 0.0)
        return Slow(side * excess, side * turn)


class RippleSlack(eqx.Module):
    """Dead band of the slow rate, which may be ripple that is not yet estimated.

    `enter` (rad/s) applies when the end game takes over; for the hand-back the band is `stay` at
    first and decreases until the time `known` (s), when the ripple is known.
    """

    enter: RealScalar = eqx.field(converter=positive("enter"))
    stay: RealScalar = eqx.field(converter=positive("stay"))
    known: RealScalar = eqx.field(converter=positive("known"))

    def to_enter(self, slow: Slow) -> Slow:
        """The slow errors that decide the take-over of the end game."""
        return _less(slow, self.enter)

    def to_stay(self, slow: Slow, clock: RealScalar | float) -> Slow:
        """The slow errors that decide its hand-back `clock` (s) after the stage began."""
        return _less(slow, self.stay * jnp.clip(1 - clock / self.known, 0.0, 1.0))


class TurnRoom(eqx.Module):
    """Limits on the `tilt` of the body's third axis and on its `turn` about that axis, rad."""

    turn: RealScalar = eqx.field(converter=positive("turn"))
    tilt: RealScalar = eqx.field(converter=positive("tilt"))

    def about_n(self, axes: Matrix, held: Vector) -> tuple[RealScalar, RealScalar]:
        """The middle of the turns about n within the limits, and half of their range (rad).

        The rows of `axes` are x, y and n in body axes. A body at a turn about n has the parts of
        the `held` rotation vector (rad) along x and y, too. To first order, and no less than
        `AIMED_TURN`.
        """
        n, beside = axes[2], held[:2] @ axes[:2]
        about = jnp.where(n[2] < 0, -1, 1) * jnp.maximum(jnp.abs(n[2]), LEAST_PART)
        across = jnp.maximum(jnp.sum(n[:2] ** 2), LEAST_PART**2)
        nearest = -jnp.sum(beside[:2] * n[:2]) / across
        left = self.tilt**2 - jnp.sum(beside[:2] ** 2)
        wide = jnp.sqrt(jnp.maximum(nearest**2 + left / across, TINY))
        middle, half = -beside[2] / about, self.turn / jnp.abs(about)
        low = jnp.maximum(middle - half, nearest - wide)
        high = jnp.minimum(middle + half, nearest + wide)
        return (low + high) / 2, jnp.maximum((high - low) / 2, AIMED_TURN)


def _less(slow: Slow, slack: RealScalar) -> Slow:
    size = jnp.maximum(jnp.abs(slow.rate) - slack, 0.0)
    return Slow(jnp.sign(slow.rate) * size, slow.turn)


class Handover(eqx.Module):
    """Conditions for take-over and hand-back of the end game.

    It takes over when |w|, the slow turn and the turn at which the end game will have stopped the
    slow rate are below `enter_angle`, the same turns from the target attitude are below
    `enter_turn`, and |p1|, |p2| less their values at rest below `enter_rate`; it hands back when
    |w| exceeds `leave_tilt` or one of the turns from the target attitude `leave_turn` (rad, rad/s).
    If it `coasts`, a hold begins against a drift that the end game cannot balance, and ends only
    when the turn itself exceeds `leave_turn` (see `UnbalancedDrift`): each hand-back takes rates
    far above those of the end game; it may begin within `aim_slack` (rad/s) of the aimed slow rate,
    if given. The first one is judged, as it begins before the drift is known. A hold
    within the balanced drift also ends at a turn of `leave_held` (rad), if given, from the held
    attitude: that may be far from the target, but beyond this turn gravity gradient soon
    turns the body faster than the oscillation. `slack` is the dead band of the slow rate,
    None for no band. With an `aimed_turn` (rad), which is A, the large oscillation before a hold
    against a drift steers the slow rate alone while the turn is within A. Steering a turn beside a
    slow rate that is not zero would take an oscillation that never ends. With a `room` the limits
    on turns from the target are those that the held attitude leaves (`around`).
    """

    enter_rate: RealScalar = eqx.field(converter=positive("enter_rate"))
    enter_angle: RealScalar = eqx.field(converter=positive("enter_angle"), default=0.03)
    enter_turn: RealScalar = eqx.field(converter=positive("enter_turn"), default=0.04)
    leave_tilt: RealScalar = eqx.field(converter=positive("leave_tilt"), default=0.04)
    leave_turn: RealScalar = eqx.field(converter=positive("leave_turn"), default=0.045)
    coasts: bool = eqx.field(static=True, default=False)
    slack: RippleSlack | None = None
    aim_slack: RealScalar | None = None
    leave_held: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    aimed_turn: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    room: TurnRoom | None = None

    def around(self, axes: Matrix, held: Vector) -> tuple["Handover", RealScalar]:
        """The hand-over at a `held` attitude, a rotation vector along (x, y, n) from the target
        (rad), and its turn from the middle of those allowed. The rows of `axes` are x, y and n."""
        if self.room is None:
            return self, held[2]
        middle, half = self.room.about_n(axes, held)
        enter = self.enter_turn * half / self.leave_turn
        return dataclasses.replace(self, enter_turn=enter, leave_turn=half), held[2] - middle

    def __call__(
        self,
        late: BoolScalar,
        tilt: Tilt,
        slow: Slow,
        excess: Vector,
        deceleration: RealScalar,
        held_turn: RealScalar,
        coast: UnbalancedDrift | None = None,
        clock: RealScalar | float = 0.0,
    ) -> BoolScalar:
        """Whether the end game is active now, from whether it was (`late`).

        `excess` is (p1, p2, s) less its value at rest (rad/s), `deceleration` the end game's
        largest deceleration of the slow rate (rad/s²), `held_turn` the turn about n from the
        target attitude to the held one (rad), from which the slow turn is measured, and `clock` the
        time since the stage began (s).
        """
        first = lasting = slow
        if self.slack is not None:
            first, lasting = self.slack.to_enter(slow), self.slack.to_stay(slow, clock)
        from_held, from_wanted = _farthest(first, held_turn, deceleration)
        leave = _farthest(lasting, held_turn, deceleration)[1] > self.leave_turn
        error = Slow(slow.rate, slow.turn + held_turn)
        if coast is not None:
            short = jnp.where(coast.drifts, ~coast.lasts(error, self.leave_turn, ENOUGH), leave)
            leave = (jnp.abs(error.turn) > self.leave_turn) | (short & coast.judged)
            if self.leave_held is not None:
                leave = leave | (~coast.drifts & (jnp.abs(slow.turn) > self.leave_held))
            from_held, from_wanted = _farthest(slow, held_turn, coast.deceleration(deceleration))
            from_held = jnp.where(coast.drifts, 0.0, from_held)
        enter = (
            (tilt.size < self.enter_angle)
            & (from_held < self.enter_angle)
            & (from_wanted < self.enter_turn)
            & (jnp.abs(excess[0]) < self.enter_rate)
            & (jnp.abs(excess[1]) < self.enter_rate)
        )
        if coast is not None:
            enter = enter & coast.lasts(error, self.leave_turn, NEAR_AIM, self.aim_slack)
        leave = leave | (tilt.size > self.leave_tilt)
        return jnp.where(late, ~leave, enter)


def _farthest(
    slow: Slow, held_turn: RealScalar, deceleration: RealScalar
) -> tuple[RealScalar, RealScalar]:
    """The larger of the turn now and after stopping the slow rate, from the held attitude and from
    the target."""
    stopping = slow.rate * jnp.abs(slow.rate) / (2 * deceleration)
    from_held, from_wanted = (
        jnp.maximum(jnp.abs(turn), jnp.abs(turn + stopping))
        for turn in (slow.turn, slow.turn + held_turn)
    )
    return from_held, from_wanted
