"""Holding against a drift that exceeds what the oscillation of the end game balances.

What is left of such a drift, d, moves the slow turn along a parabola. A hold that begins with the
slow rate √(2 |d| A) against it turns by A the other way first, and stays within its limits for
about twice as long as one that begins at rest.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.oscillatory import Slow

RealScalar = Float[Array, ""]

AIMED_TURN = 0.02
"""A (rad). Settled means within 0.05."""

NEAR_AIM, ENOUGH = 0.85, 0.75
"""Of the time that a hold lasts which begins as aimed at: one that would last for the first share
begins, one that will last for the second is kept."""

KNOWN_PERIODS = 10
"""Of the oscillation: the age at which the first hold is judged, as the drift is known well."""

TINY = 1e-30
"""Keeps the derivative of a root finite."""


class Hold(NamedTuple):
    """When the present hold began (s), and whether one has lasted until the drift was known.

    While there is none, `begin` is the present time: only a hold has an age, as the drift is learnt
    while the other rates are small.
    """

    begin: RealScalar
    known: Bool[Array, ""]

    @staticmethod
    def none(omega: Float[Array, "3"]) -> "Hold":
        """Before the first."""
        return Hold(jnp.zeros_like(omega[0]), jnp.array(False))

    def after(self, holds: Bool[Array, ""], clock: RealScalar, coast: "Coast") -> "Hold":
        """At a `clock` (s) when the end game `holds` or not, with what has become known now."""
        return Hold(jnp.where(holds, self.begin, clock), self.known | coast.judged)


class Coast(NamedTuple):
    """What the end game cannot balance of the drift, and whether a hold is to be judged now.

    The end game balances a drift up to `sure`; what is left, `drift` (rad/s²), is zero for a
    smaller one, and until the drift is known.
    """

    drift: RealScalar
    sure: RealScalar
    judged: Bool[Array, ""]

    @staticmethod
    def of(
        hold: Hold, clock: RealScalar, frequency: RealScalar, drift: RealScalar, sure: RealScalar
    ) -> "Coast":
        """For a `drift` (rad/s²) of which `sure` is balanced; `frequency` (rad/s) is that of the
        oscillation, `clock` in s."""
        old = (clock - hold.begin) * frequency > KNOWN_PERIODS * 2 * jnp.pi
        beyond = jnp.where(hold.known | old, drift - jnp.clip(drift, -sure, sure), 0.0)
        return Coast(beyond, sure, old & ~hold.known)

    @property
    def drifts(self) -> Bool[Array, ""]:
        """Whether anything is left."""
        return self.drift != 0

    def aim(self, turn: RealScalar) -> RealScalar:
        """The slow rate (rad/s) with which a hold should begin at a `turn` (rad)."""
        way = jnp.maximum(AIMED_TURN + jnp.sign(self.drift) * turn, 0.0)
        return -jnp.sign(self.drift) * jnp.sqrt(2 * jnp.abs(self.drift) * way + TINY)

    def lasts(self, slow: Slow, limit: RealScalar, share: float) -> Bool[Array, ""]:
        """Whether a hold lasts for that `share` of the time of one that begins here as aimed at.

        It ends where the turn exceeds the `limit` (rad). One that turns beyond it against the drift
        does not last.
        """
        side, size = jnp.sign(self.drift), jnp.abs(self.drift)
        way = jnp.maximum(limit - side * slow.turn, 0.0)
        back = jnp.maximum(limit + side * slow.turn, 0.0)

        def time(rate):  # times the drift
            return jnp.sqrt(rate**2 + 2 * size * way + TINY) - rate

        stops = -side * slow.rate < jnp.sqrt(2 * (size + self.sure) * back + TINY)
        long = time(side * slow.rate) >= share * time(side * self.aim(slow.turn))
        return ~self.drifts | (stops & long)

    def deceleration(self, own: RealScalar) -> RealScalar:
        """Of a slow rate with which a hold begins (rad/s²); `own` is that of the end game."""
        return jnp.where(self.drifts, jnp.abs(self.drift) + 2 * self.sure, own)

    def opposed(self, slow: Slow, turn: RealScalar | float) -> Slow:
        """What the end game is told of a hold against the drift.

        A `turn` (rad) that asks for all that it can do, and by how much the slow rate exceeds the
        one aimed at, as a hold that begins too fast must not turn too far.
        """
        side = jnp.sign(self.drift)
        excess = jnp.minimum(side * (slow.rate - self.aim(slow.turn)), 0.0)
        return Slow(side * excess, side * turn)
