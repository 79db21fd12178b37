"""Motion of wheels: the torque between two instants at which it jumps, and these instants.

Without a rotor inertia, or while the body turns evenly, the momentum of a wheel under a held
command obeys a scalar linear ODE, and is monotonic in time. So the instants at which it reaches
zero, where Coulomb friction may hold it, and its limit have closed forms.

The momentum of a wheel whose rotor has an inertia is also changed by the drag J_w a·dω/dt of an
accelerating body:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

So a wheel at rest is held by Coulomb friction up to |c + J_w a·dω/dt| = τ, one at its momentum
limit is held until both together slow it down, and held wheels turn with the body as if locked.
"""

from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import RealScalar

if TYPE_CHECKING:
    from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " wheels"]

SMALL = 1e-4
"""Threshold below which -log(1 - x)/x is taken from its series, whose next term is x⁵/6."""


class WheelPiece(NamedTuple):
    """Wheels between two edges: turning wheels put the torque drive + decay h on the body, N m.

    `drive` in N m and `decay` in 1/s, of shape (wheels,), are constant while the command is.
    `turns` marks wheels whose momentum relative to the body changes; None for wheels without a
    rotor inertia, of which held wheels make no torque.
    """

    drive: Float[Array, " wheels"]
    decay: Float[Array, " wheels"]
    turns: Bool[Array, " wheels"] | None = None

    def torque(self, momentum: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """Return the torque of motor and friction along each axis, N m, at these momenta, N m s.

        Zero for wheels that do not turn.
        """
        return self.drive + self.decay * momentum


def time_to(target, begin, piece: WheelPiece) -> Float[Array, " wheels"]:
    """Return seconds until momenta get from `begin` to `target` ahead; infinite if never.

    Zero for a target that is behind by round-off.
    """
    speed = -piece.torque(begin)
    moves = (speed != 0) & jnp.isfinite(target)
    distance = jnp.where(moves, target - begin, 0.0)
    straight = jnp.maximum(distance / jnp.where(moves, speed, 1.0), 0.0)
    share = piece.decay * straight  # of the way to where friction alone would stop them
    reached = moves & (share < 1)
    return jnp.where(reached, straight * _log_ratio(jnp.where(reached, share, 0.0)), jnp.inf)


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


def edges_of(
    wheels: "Wheels", momentum: OfEach, command: OfEach, period: RealScalar
) -> Float[Array, " edges"]:
    """Return instants (s) in [0, `period`] at which the torque of a wheel jumps, unordered.

    The command is held for the `period` (s), from `momentum` (N m s) on. Each wheel has one edge
    where it comes to rest, if there is Coulomb friction, and one at its limit, if it has one:
    `period` for an event that does not happen.
    """
    course = _course(wheels, momentum, command)
    edges = [] if wheels.coulomb_friction is None else [course.zero]
    edges += [] if wheels.momentum_limit is None else [course.limit]
    return jnp.minimum(jnp.concatenate([*edges, jnp.zeros(0, momentum.dtype)]), period)


def piece_after(
    wheels: "Wheels", momentum: OfEach, command: OfEach, elapsed: RealScalar
) -> WheelPiece:
    """Return the piece `elapsed` seconds after the begin of a hold at `momentum`.

    Callers evaluate it midway between two edges, where round-off has no effect.
    """
    course, drive = _course(wheels, momentum, command), wheels.motor_torque(command)
    side = jnp.where(elapsed < course.zero, course.before, course.after)
    piece = _piece(wheels, drive, side)
    limited = elapsed >= course.limit
    drive, decay = jnp.where(limited, 0.0, piece.drive), jnp.where(limited, 0.0, piece.decay)
    return WheelPiece(drive, decay)


def snapped(
    wheels: "Wheels", momentum: OfEach, command: OfEach, elapsed: RealScalar, reached: OfEach
) -> OfEach:
    """Return the momenta `reached` (N m s) `elapsed` seconds after the begin of a hold at
    `momentum`: exactly zero, or the limit, at the edge where they reach it."""
    course = _course(wheels, momentum, command)
    if wheels.momentum_limit is not None:
        limit = jnp.sign(reached) * wheels.momentum_limit
        reached = jnp.where(elapsed == course.limit, limit, reached)
    return jnp.where(elapsed == course.zero, 0.0, reached)


def unlimited_torque(wheels: "Wheels", momentum: OfEach, command: OfEach) -> OfEach:
    """Return the torque on the body along each axis without momentum limits, N m."""
    drive = wheels.motor_torque(command)
    return _piece(wheels, drive, _side(wheels, momentum, drive)).torque(momentum)


def _side(wheels: "Wheels", momentum: OfEach, drive: OfEach) -> OfEach:
    """Return the sign of Coulomb friction: zero for a wheel that it holds at rest."""
    if wheels.coulomb_friction is None:
        return jnp.zeros_like(drive)
    from_rest = jnp.where(jnp.abs(drive) > wheels.coulomb_friction, -jnp.sign(drive), 0.0)
    return jnp.where(momentum == 0, from_rest, jnp.sign(momentum))


def _piece(wheels: "Wheels", drive: OfEach, side: OfEach) -> WheelPiece:
    """Return the piece of wheels below their limits with these signs of Coulomb friction."""
    decay = jnp.zeros_like(drive) + wheels.decay
    if wheels.coulomb_friction is None:
        return WheelPiece(drive, decay)
    rests = side == 0
    drive = drive + wheels.coulomb_friction * side
    return WheelPiece(jnp.where(rests, 0.0, drive), jnp.where(rests, 0.0, decay))


def _course(wheels: "Wheels", momentum: OfEach, command: OfEach) -> _Course:
    drive = wheels.motor_torque(command)
    before = _side(wheels, momentum, drive)
    after = _side(wheels, jnp.zeros_like(momentum), drive)
    never = jnp.full_like(momentum, jnp.inf)
    zero = limit = never
    if wheels.coulomb_friction is not None:
        piece = _piece(wheels, drive, before)
        slows = piece.torque(momentum) * momentum > 0
        zero = jnp.where(slows, time_to(jnp.zeros_like(momentum), momentum, piece), never)
    if wheels.momentum_limit is not None:
        crosses = jnp.isfinite(zero)
        begin = jnp.where(crosses, 0.0, momentum)
        piece = _piece(wheels, drive, jnp.where(crosses, after, before))
        target = -jnp.sign(piece.torque(begin)) * wheels.momentum_limit
        limit = jnp.where(crosses, zero, 0.0) + time_to(target, begin, piece)
    return _Course(before, after, zero, limit)


class WheelStates(NamedTuple):
    """Mode of each wheel: whether it `rests`, is `limited` to its momentum, or turns.

    `side` is the sign of its Coulomb friction, zero where it rests or turns about zero.
    """

    side: OfEach
    rests: Bool[Array, " wheels"]
    limited: Bool[Array, " wheels"]

    @property
    def turns(self) -> Bool[Array, " wheels"]:
        """Whether each wheel's momentum relative to the body changes."""
        return ~(self.rests | self.limited)

    def piece(self, wheels: "Wheels", drive: OfEach) -> WheelPiece:
        """Return the torque of `wheels` in these states with the motor torques `drive` (N m)."""
        drive, decay = self._unheld(wheels, drive)
        turns = self.turns
        return WheelPiece(jnp.where(turns, drive, 0.0), jnp.where(turns, decay, 0.0), turns)

    def _unheld(self, wheels: "Wheels", drive: OfEach) -> tuple[OfEach, OfEach]:
        if wheels.coulomb_friction is not None:
            drive = drive + wheels.coulomb_friction * self.side
        return drive, wheels.decay + jnp.zeros_like(drive)

    def margins(
        self, wheels: "Wheels", momentum: OfEach, drive: OfEach, drag: OfEach
    ) -> Float[Array, "2 wheels"]:
        """Return the margin of each wheel's state: below zero for a wheel that has left it.

        The first row is for rest and holds, the second for the momentum limit. In N m s for turning
        wheels, in N m for others; `drag` (N m) is J_w a·dω/dt.
        """
        torque, decay = self._unheld(wheels, drive)
        slowing = torque + decay * momentum + drag
        never = jnp.full_like(momentum, jnp.inf)
        held = jnp.where(self.limited, -slowing * jnp.sign(momentum), never)
        first, second = held, never
        if wheels.coulomb_friction is not None:
            friction = wheels.coulomb_friction
            passes = jnp.maximum(self.side * momentum, -slowing * self.side)
            rubs = self.turns & (friction > 0) & (self.side != 0)
            first = jnp.where(rubs, passes, held)
            rests = friction - jnp.abs(drive + drag)
            first = jnp.where(self.rests, rests, first)
        if wheels.momentum_limit is not None:
            room = wheels.momentum_limit - jnp.abs(momentum)
            room = jnp.maximum(room, slowing * jnp.sign(momentum))
            second = jnp.where(self.turns, room, never)
        if wheels.seized is not None:
            first = jnp.where(wheels.seized, never, first)
        return jnp.stack([first, second])

    def left(self, margins: Float[Array, "2 wheels"], drive: OfEach, drag: OfEach) -> "WheelStates":
        """Return the states after leaving those with a margin below zero.

        A wheel whose momentum reaches zero rests, if only until its own margin is evaluated.
        """
        first, second = margins < 0
        stops, goes = first & self.turns, first & self.rests
        side = jnp.where(goes, -jnp.sign(drive + drag), jnp.where(stops, 0.0, self.side))
        return WheelStates(
            side, (self.rests & ~first) | stops, (self.limited & ~first) | (second & ~stops)
        )

    def snapped(
        self, wheels: "Wheels", momentum: OfEach, margins: Float[Array, "2 wheels"]
    ) -> OfEach:
        """Return momenta (N m s), exactly zero or the limit for wheels that reached it."""
        first, second = margins < 0
        if wheels.momentum_limit is not None:
            limit = wheels.momentum_limit
            limit = jnp.where(jnp.isfinite(limit), limit, 0.0)
            momentum = jnp.where(second, jnp.sign(momentum) * limit, momentum)
        return jnp.where(first & self.turns, 0.0, momentum)


def first_states(wheels: "Wheels", momentum: OfEach) -> WheelStates:
    """Return the states of wheels by their momenta (N m s) alone, held wherever possible."""
    never = jnp.zeros_like(momentum) > 0
    rests = limited = never
    if wheels.coulomb_friction is not None:
        rests = (momentum == 0) & (wheels.coulomb_friction > 0)
    if wheels.seized is not None:
        rests = rests | wheels.seized
    if wheels.limited is not None:
        limited = wheels.limited & ~rests
    elif wheels.momentum_limit is not None:
        limited = (jnp.abs(momentum) >= wheels.momentum_limit) & ~rests
    return WheelStates(jnp.sign(momentum), rests, limited)
