"""Wheels under a held command: the edges at which their torque jumps, and the pieces between.

Without a rotor inertia, or while the body turns evenly, the momentum of a wheel obeys a scalar
linear ODE, and is monotonic in time. So the instants at which it reaches zero, where Coulomb
friction may hold it, and its limit have closed forms.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.spacecraft.wheel_motion import (
    AbstractWheels,
    OfEach,
    WheelMomenta,
    WheelPiece,
    WheelStates,
)

SMALL = 1e-4
"""Threshold below which -log(1 - x)/x is taken from its series, whose next term is x⁵/6."""


def time_to(target, begin, piece: WheelPiece) -> Float[Array, " wheels"]:
    """Return seconds until momenta get from `begin` to `target` ahead; infinite if never.

    Zero for a target that is behind by round-off.
    """
    speed = -piece.torque(begin)
    moves = (speed != 0) & jnp.isfinite(target)
    distance = jnp.where(moves, target - begin, 0.0)
    straight = jnp.maximum(distance / jnp.where(moves, speed, 1.0), 0.0)
    share = piece.decay * straight  # of the way to where friction alone would stop them
    arrives = moves & (share < 1)
    return jnp.where(arrives, straight * _log_ratio(jnp.where(arrives, share, 0.0)), jnp.inf)


def _log_ratio(x: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
    """Return -log(1 - x) / x for x in [0, 1), 1 at zero."""
    series = 1 + x * (1 / 2 + x * (1 / 3 + x * (1 / 4 + x / 5)))
    small = x < SMALL
    away = jnp.where(small, 0.5, x)
    return jnp.where(small, series, -jnp.log1p(-away) / away)


class _Course(NamedTuple):
    """Course of momenta under a held command.

    The sign of Coulomb friction `before` and `after` the instant `zero` (s) at which a momentum
    reaches zero, and the instant `limit` (s) at which it reaches its limit; infinite if never.
    """

    before: OfEach
    after: OfEach
    zero: OfEach
    limit: OfEach


class AbstractHeldWheels(AbstractWheels):
    """Wheels whose motors hold their torque from one instant to another."""

    @property
    def edge_count(self) -> int:
        """Number of edges: one for each wheel if there is Coulomb friction, and one for each if
        there is a momentum limit."""
        return self.count * sum(x is not None for x in (self.coulomb_friction, self.momentum_limit))

    @property
    def follows_body(self) -> bool:
        """Whether edges must be searched: if rotors have an inertia and wheels may be held."""
        holds = self.edge_count > 0 or self.seized is not None
        return self.rotor_inertia is not None and holds

    def edges(self, state: WheelMomenta, command, period) -> Float[Array, " edges"]:
        """Return instants (s) in [0, `period`] at which the torque of a wheel jumps, unordered.

        Each wheel has one edge where it comes to rest, if there is Coulomb friction, and one at its
        limit, if it has one: `period` for an event that does not happen.
        """
        course = self._course(state.momentum, command)
        edges = [] if self.coulomb_friction is None else [course.zero]
        edges += [] if self.momentum_limit is None else [course.limit]
        return jnp.minimum(jnp.concatenate([*edges, jnp.zeros(0, state.momentum.dtype)]), period)

    def held_piece(self, state: WheelMomenta, command, elapsed) -> WheelPiece:
        """Return the piece after `elapsed` s, for an even body rate or without a rotor inertia.

        Callers evaluate it midway between two edges, where round-off has no effect.
        """
        course, drive = self._course(state.momentum, command), self.motor_torque(command)
        side = jnp.where(elapsed < course.zero, course.before, course.after)
        piece = self._piece(drive, side)
        limited = elapsed >= course.limit
        drive, decay = jnp.where(limited, 0.0, piece.drive), jnp.where(limited, 0.0, piece.decay)
        return WheelPiece(drive, decay)

    def snapped(self, state: WheelMomenta, command, elapsed, reached: WheelMomenta) -> WheelMomenta:
        """Return the state with momenta exactly zero, or at the limit, at the edge there."""
        course, momentum = self._course(state.momentum, command), reached.momentum
        if self.momentum_limit is not None:
            limit = jnp.sign(momentum) * self.momentum_limit
            momentum = jnp.where(elapsed == course.limit, limit, momentum)
        return WheelMomenta(jnp.where(elapsed == course.zero, 0.0, momentum))

    def unlimited_torque(self, momentum: OfEach, command: OfEach) -> OfEach:
        """Return the torque on the body along each axis without momentum limits, N m."""
        drive = self.motor_torque(command)
        return self._piece(drive, self._side(momentum, drive)).torque(momentum)

    def margins(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """Return the margins of wheels to leaving rest or a hold, and to their momentum limit."""
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.margins(self, state.momentum, drive, drag)

    def approach(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """Return the rates of the margins of turning wheels; others leave without a jump."""
        rate = self._rate(self.piece(mode, command), state, acceleration)
        speeds = jnp.stack([mode.side * rate, -jnp.sign(state.momentum) * rate])
        return jnp.where(mode.turns[None], speeds, 0.0)

    def come(self, mode: WheelStates, state: WheelMomenta, margins) -> WheelMomenta:
        """Return the state, momenta exactly zero or at the limit for wheels that reached it."""
        return WheelMomenta(mode.snapped(self, state.momentum, margins))

    def _side(self, momentum: OfEach, drive: OfEach) -> OfEach:
        """Return the sign of Coulomb friction: zero for a wheel that it holds at rest."""
        if self.coulomb_friction is None:
            return jnp.zeros_like(drive)
        from_rest = jnp.where(jnp.abs(drive) > self.coulomb_friction, -jnp.sign(drive), 0.0)
        return jnp.where(momentum == 0, from_rest, jnp.sign(momentum))

    def _piece(self, drive: OfEach, side: OfEach) -> WheelPiece:
        """Return the piece of wheels below their limits with these signs of Coulomb friction."""
        decay = jnp.zeros_like(drive) + self.decay
        if self.coulomb_friction is None:
            return WheelPiece(drive, decay)
        rests = side == 0
        drive = drive + self.coulomb_friction * side
        return WheelPiece(jnp.where(rests, 0.0, drive), jnp.where(rests, 0.0, decay))

    def _course(self, momentum: OfEach, command: OfEach) -> _Course:
        drive = self.motor_torque(command)
        before = self._side(momentum, drive)
        after = self._side(jnp.zeros_like(momentum), drive)
        never = jnp.full_like(momentum, jnp.inf)
        zero = limit = never
        if self.coulomb_friction is not None:
            piece = self._piece(drive, before)
            slows = piece.torque(momentum) * momentum > 0
            zero = jnp.where(slows, time_to(jnp.zeros_like(momentum), momentum, piece), never)
        if self.momentum_limit is not None:
            crosses = jnp.isfinite(zero)
            begin = jnp.where(crosses, 0.0, momentum)
            piece = self._piece(drive, jnp.where(crosses, after, before))
            target = -jnp.sign(piece.torque(begin)) * self.momentum_limit
            limit = jnp.where(crosses, zero, 0.0) + time_to(target, begin, piece)
        return _Course(before, after, zero, limit)
