"""Reaction wheels: what torque they make, and when their momenta meet a limit or zero.

A wheel's momentum h is that relative to the body, and the inertia of the spacecraft is the one with
its wheels locked. A motor that is commanded a torque c turns the body by c and the wheel by -c;
viscous and Coulomb friction b and τ brake the wheel and take the body along. A rotor with the
inertia J_w about its axis a also stays behind where the body turns faster:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

At its limit a wheel takes no torque that would raise its momentum further. Without a rotor inertia,
and while a command stays, the momentum of each wheel is a scalar linear ODE, monotonic in time, so
the instants at which it comes to zero, where Coulomb friction may hold it, and to its limit are
closed forms. With one they depend on the body: `jaxsat.spacecraft.wheel_states`.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxsat.core.checks import as_float, concrete, require_finite, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.axes import unit_axes
from jaxsat.spacecraft.wheel_failures import WheelCondition, WheelFailures
from jaxsat.spacecraft.wheel_piece import WheelPiece, time_to

OfEach = ArrayLike | list | tuple | None
"""One number, one for each wheel, or None."""


class _Course(NamedTuple):
    """How momenta go under a command that stays.

    The sign of Coulomb friction `before` and `after` the instant `zero` (s) at which a momentum
    comes to zero, and the instant `limit` (s) at which it comes to its limit; infinite for never.
    """

    before: Float[Array, " wheels"]
    after: Float[Array, " wheels"]
    zero: Float[Array, " wheels"]
    limit: Float[Array, " wheels"]


class Wheels(eqx.Module):
    """Reaction wheels along any axes, of shape (3, wheels) in body axes, scaled to unit length.

    `torque_limit` (N m) bounds each motor's torque and `momentum_limit` (N m s) each momentum.
    `rotor_inertia` (kg m²) is that of each rotor about its axis, part of the spacecraft's inertia.
    `viscous_friction` (N m s/rad), which needs it, and `coulomb_friction` (N m) brake the rotors.
    Each is one number, or one for each wheel, and None for none. `failures` strike them in flight.
    `limited` holds each wheel at its momentum limit or off it, see `smooth_piece`, `seized` those
    at rest that have seized. Raises `ValueError` for numbers that no wheel has.
    """

    axes: Float[Array, "3 wheels"]
    torque_limit: Float[Array, " wheels"] | None
    momentum_limit: Float[Array, " wheels"] | None
    rotor_inertia: Float[Array, " wheels"] | None
    viscous_friction: Float[Array, " wheels"] | None
    coulomb_friction: Float[Array, " wheels"] | None
    failures: WheelFailures | None
    limited: Bool[Array, " wheels"] | None
    seized: Bool[Array, " wheels"] | None

    def __init__(
        self,
        axes: ArrayLike | list,
        torque_limit: OfEach = None,
        momentum_limit: OfEach = None,
        rotor_inertia: OfEach = None,
        viscous_friction: OfEach = None,
        coulomb_friction: OfEach = None,
        failures: WheelFailures | None = None,
    ):
        self.axes = unit_axes(as_float(axes))
        self.torque_limit = self._of_each(torque_limit)
        self.momentum_limit = self._of_each(momentum_limit)
        self.rotor_inertia = self._of_each(rotor_inertia)
        self.viscous_friction = self._of_each(viscous_friction)
        self.coulomb_friction = self._of_each(coulomb_friction)
        self.failures = failures
        self.limited = None
        self.seized = None

    def __check_init__(self):
        for name in ("torque_limit", "momentum_limit"):
            if getattr(self, name) is not None:
                require_positive(name, getattr(self, name))
        for name in ("rotor_inertia", "viscous_friction", "coulomb_friction"):
            if getattr(self, name) is not None:
                require_finite(name, getattr(self, name))
                require_positive(name, getattr(self, name), zero_allowed=True)
        if self.viscous_friction is None:
            return
        if self.rotor_inertia is None:
            raise ArgumentError("rotor_inertia", "must be given with viscous friction", None)
        friction, inertia = concrete(self.viscous_friction), concrete(self.rotor_inertia)
        if friction is not None and inertia is not None and np.any((friction > 0) & (inertia == 0)):
            message = "must be above zero for each wheel with viscous friction"
            raise ArgumentError("rotor_inertia", message, inertia)

    def _of_each(self, value: OfEach) -> Float[Array, " wheels"] | None:
        return None if value is None else as_float(value) * jnp.ones(self.count)

    @property
    def count(self) -> int:
        """How many wheels there are."""
        return self.axes.shape[1]

    @property
    def edge_count(self) -> int:
        """How many `edges` there are in a hold."""
        return self.count * sum(x is not None for x in (self.coulomb_friction, self.momentum_limit))

    def rotors(self, turns: Bool[Array, " wheels"] | None = None) -> Float[Array, "3 3"]:
        """Σ J_w a aᵀ (kg m²) over the wheels that turn, by default all: their part of the body."""
        if self.rotor_inertia is None:
            return jnp.zeros((3, 3))
        inertia = self.rotor_inertia if turns is None else jnp.where(turns, self.rotor_inertia, 0.0)
        return self.axes @ (inertia[:, None] * self.axes.T)

    @property
    def decay(self) -> Float[Array, " wheels"]:
        """b / J_w: the part of a momentum that viscous friction takes a second, 1/s."""
        if self.viscous_friction is None or self.rotor_inertia is None:
            return jnp.zeros(self.count)
        inertia = jnp.where(self.rotor_inertia > 0, self.rotor_inertia, 1.0)
        return self.viscous_friction / inertia

    def motor_torque(self, command: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """The torque that motors make on a command, N m, without friction and momentum limit."""
        if self.torque_limit is None:
            return command
        return jnp.clip(command, -self.torque_limit, self.torque_limit)

    def torque(
        self, momentum: Float[Array, " wheels"], command: Float[Array, " wheels"]
    ) -> Float[Array, " wheels"]:
        """The torque on the body along each axis, N m, at one instant; dh/dt is its negative.

        So it is without a rotor inertia, or while the body turns evenly.
        """
        torque = self._unlimited(momentum, command)
        if self.momentum_limit is None:
            return torque
        limited = self.limited
        if limited is None:
            limited = (jnp.abs(momentum) >= self.momentum_limit) & (torque * momentum < 0)
        return jnp.where(limited, 0.0, torque)

    def _unlimited(self, momentum, command) -> Float[Array, " wheels"]:
        """The torque off the momentum limits."""
        drive = self.motor_torque(command)
        return self._piece(drive, self._side(momentum, drive)).torque(momentum)

    def _side(self, momentum, drive) -> Float[Array, " wheels"]:
        """The sign of Coulomb friction: zero for a wheel that it holds at rest."""
        if self.coulomb_friction is None:
            return jnp.zeros_like(drive)
        from_rest = jnp.where(jnp.abs(drive) > self.coulomb_friction, -jnp.sign(drive), 0.0)
        return jnp.where(momentum == 0, from_rest, jnp.sign(momentum))

    def _piece(self, drive, side) -> WheelPiece:
        """Wheels off their limits whose Coulomb friction has these signs."""
        decay = jnp.zeros_like(drive) + self.decay
        if self.coulomb_friction is None:
            return WheelPiece(drive, decay)
        rests = side == 0
        drive = drive + self.coulomb_friction * side
        return WheelPiece(jnp.where(rests, 0.0, drive), jnp.where(rests, 0.0, decay))

    # Failures in flight.

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When each failure strikes, s."""
        return jnp.zeros(0) if self.failures is None else self.failures.at

    def driven(
        self,
        condition: WheelCondition,
        momentum: Float[Array, " wheels"],
        command: Float[Array, " wheels"],
    ) -> "tuple[Wheels, Float[Array, ' wheels']]":
        """Wheels that fail no more but are in this condition, and what their motors make, N m."""
        coulomb = jnp.zeros_like(momentum)
        if self.coulomb_friction is not None:
            coulomb = self.coulomb_friction
        coulomb = jnp.maximum(condition.friction * coulomb, condition.coulomb)
        viscous = self.viscous_friction
        if viscous is not None:
            viscous = condition.friction * viscous
        seized = None if self.rotor_inertia is None else condition.stopped
        wheels = eqx.tree_at(
            lambda one: (one.coulomb_friction, one.viscous_friction, one.failures, one.seized),
            self,
            (coulomb, viscous, None, seized),
            is_leaf=lambda x: x is None,
        )
        torque = condition.command(self.motor_torque(command), momentum, self.torque_limit)
        return wheels, torque

    def without_corners(self) -> "Wheels":
        """The same without Coulomb friction and failures in flight."""
        return eqx.tree_at(
            lambda one: (one.coulomb_friction, one.failures),
            self,
            (None, None),
            is_leaf=lambda x: x is None or isinstance(x, WheelFailures),
        )

    # A held command: edges, and the piece between two of them.

    def edges(
        self,
        momentum: Float[Array, " wheels"],
        command: Float[Array, " wheels"],
        period: Float[Array, ""],
    ) -> Float[Array, " edges"]:
        """Instants (s) in [0, `period`] at which the torque of a wheel jumps, in no order.

        The command stays for the `period` (s), from `momentum` (N m s) on. Each wheel has one edge
        where it comes to rest, if there is Coulomb friction, and one at its limit, if it has one:
        `period` where that does not happen. So it is without a rotor inertia, or while the body
        turns evenly.
        """
        course = self._course(momentum, command)
        found = [] if self.coulomb_friction is None else [course.zero]
        found += [] if self.momentum_limit is None else [course.limit]
        return jnp.minimum(jnp.concatenate([*found, jnp.zeros(0, momentum.dtype)]), period)

    def piece(
        self,
        momentum: Float[Array, " wheels"],
        command: Float[Array, " wheels"],
        elapsed: Float[Array, ""],
    ) -> WheelPiece:
        """The piece that holds `elapsed` seconds after a command began to stay at `momentum`.

        Between two edges it is asked for in their middle, where rounding decides nothing.
        """
        course, drive = self._course(momentum, command), self.motor_torque(command)
        piece = self._piece(drive, jnp.where(elapsed < course.zero, course.before, course.after))
        limited = elapsed >= course.limit
        drive, decay = jnp.where(limited, 0.0, piece.drive), jnp.where(limited, 0.0, piece.decay)
        return WheelPiece(drive, decay)

    def snapped(
        self,
        momentum: Float[Array, " wheels"],
        command: Float[Array, " wheels"],
        elapsed: Float[Array, ""],
        reached: Float[Array, " wheels"],
    ) -> Float[Array, " wheels"]:
        """What momenta have `reached` (N m s), `elapsed` seconds after a command began to stay at
        `momentum`: exactly zero, or the limit, where the edge at which they come to it is then."""
        course = self._course(momentum, command)
        if self.momentum_limit is not None:
            limit = jnp.sign(reached) * self.momentum_limit
            reached = jnp.where(elapsed == course.limit, limit, reached)
        return jnp.where(elapsed == course.zero, 0.0, reached)

    def _course(self, momentum, command) -> _Course:
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

    # A command that changes continuously: events, and the smooth piece between two of them.

    @property
    def event_count(self) -> int:
        """One for each wheel with a momentum limit."""
        return 0 if self.momentum_limit is None else self.count

    def event_functions(
        self,
        momentum: Float[Array, " wheels"],
        command: Float[Array, " wheels"],
        drag: float | Float[Array, " wheels"] = 0.0,
    ) -> Float[Array, " m"]:
        """Positive for each wheel that is held at its limit.

        A wheel comes to it by its momentum and leaves it by what drives it alone, so that rounding
        of a momentum at the limit is no event. `drag` (N m) is J_w a·dω/dt of each.
        """
        if self.momentum_limit is None:
            return jnp.zeros(0, momentum.dtype)
        driven = self._unlimited(momentum, command) + drag
        growth = -driven * momentum / self.momentum_limit**2
        arrives = jnp.minimum((momentum / self.momentum_limit) ** 2 - 1, growth)
        return arrives if self.limited is None else jnp.where(self.limited, growth, arrives)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "Wheels":
        """These wheels, at their momentum limits or not as told."""
        return self._held(signs) if self.event_count else self

    def _held(self, limited: Bool[Array, " wheels"]) -> "Wheels":
        return eqx.tree_at(lambda x: x.limited, self, limited, is_leaf=lambda x: x is None)
