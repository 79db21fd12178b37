"""Wheels under a command that stays: when their momenta meet a limit or zero, in closed form.

Without a rotor inertia, or while the body turns evenly, the momentum of each wheel is a scalar
linear ODE, monotonic in time. So the instants at which it comes to zero, where Coulomb friction may
hold it, and to its limit are closed forms. With one they depend on the body:
`jaxsat.spacecraft.wheel_states`.
"""

from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.spacecraft.wheel_piece import WheelPiece, time_to

if TYPE_CHECKING:
    from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " wheels"]


class _Course(NamedTuple):
    """How momenta go under a command that stays.

    The sign of Coulomb friction `before` and `after` the instant `zero` (s) at which a momentum
    comes to zero, and the instant `limit` (s) at which it comes to its limit; infinite for never.
    """

    before: OfEach
    after: OfEach
    zero: OfEach
    limit: OfEach


def edges_of(
    wheels: "Wheels", momentum: OfEach, command: OfEach, period: Float[Array, ""]
) -> Float[Array, " edges"]:
    """Instants (s) in [0, `period`] at which the torque of a wheel jumps, in no order.

    The command stays for the `period` (s), from `momentum` (N m s) on. Each wheel has one edge
    where it comes to rest, if there is Coulomb friction, and one at its limit, if it has one:
    `period` where that does not happen.
    """
    course = _course(wheels, momentum, command)
    found = [] if wheels.coulomb_friction is None else [course.zero]
    found += [] if wheels.momentum_limit is None else [course.limit]
    return jnp.minimum(jnp.concatenate([*found, jnp.zeros(0, momentum.dtype)]), period)


def piece_after(
    wheels: "Wheels", momentum: OfEach, command: OfEach, elapsed: Float[Array, ""]
) -> WheelPiece:
    """The piece that holds `elapsed` seconds after a command began to stay at `momentum`.

    Between two edges it is asked for in their middle, where rounding decides nothing.
    """
    course, drive = _course(wheels, momentum, command), wheels.motor_torque(command)
    side = jnp.where(elapsed < course.zero, course.before, course.after)
    piece = _piece(wheels, drive, side)
    limited = elapsed >= course.limit
    drive, decay = jnp.where(limited, 0.0, piece.drive), jnp.where(limited, 0.0, piece.decay)
    return WheelPiece(drive, decay)


def snapped(
    wheels: "Wheels",
    momentum: OfEach,
    command: OfEach,
    elapsed: Float[Array, ""],
    reached: OfEach,
) -> OfEach:
    """What momenta have `reached` (N m s), `elapsed` seconds after a command began to stay at
    `momentum`: exactly zero, or the limit, where the edge at which they come to it is then."""
    course = _course(wheels, momentum, command)
    if wheels.momentum_limit is not None:
        limit = jnp.sign(reached) * wheels.momentum_limit
        reached = jnp.where(elapsed == course.limit, limit, reached)
    return jnp.where(elapsed == course.zero, 0.0, reached)


def unlimited_torque(wheels: "Wheels", momentum: OfEach, command: OfEach) -> OfEach:
    """The torque on the body along each axis off the momentum limits, N m, at one instant."""
    drive = wheels.motor_torque(command)
    return _piece(wheels, drive, _side(wheels, momentum, drive)).torque(momentum)


def _side(wheels: "Wheels", momentum: OfEach, drive: OfEach) -> OfEach:
    """The sign of Coulomb friction: zero for a wheel that it holds at rest."""
    if wheels.coulomb_friction is None:
        return jnp.zeros_like(drive)
    from_rest = jnp.where(jnp.abs(drive) > wheels.coulomb_friction, -jnp.sign(drive), 0.0)
    return jnp.where(momentum == 0, from_rest, jnp.sign(momentum))


def _piece(wheels: "Wheels", drive: OfEach, side: OfEach) -> WheelPiece:
    """Wheels off their limits whose Coulomb friction has these signs."""
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
