"""Wheels in motion: their modes, and the torque of motor and friction in each.

The momentum of a wheel whose rotor has an inertia is also changed by the drag J_w a·dω/dt of an
accelerating body:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

So a wheel at rest is held by Coulomb friction up to |c + J_w a·dω/dt| = τ, one at its momentum
limit is held until both together slow it down, and held wheels turn with the body as if locked.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import Matrix, Vector
from jaxsat.core.checks import as_float
from jaxsat.spacecraft.effector import AbstractEffector

OfEach = Float[Array, " wheels"]

STATE_PASSES = 3
"""Number of passes for the set of held wheels, each with the rates of the last."""


class WheelMomenta(eqx.Module):
    """State of wheels: the momentum of each relative to the body, N m s."""

    momentum: Float[Array, " wheels"] = eqx.field(converter=as_float)


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

    def piece(self, wheels: "AbstractWheels", drive: OfEach) -> WheelPiece:
        """Return the torque of `wheels` in these states with the motor torques `drive` (N m)."""
        drive, decay = self._unheld(wheels, drive)
        turns = self.turns
        return WheelPiece(jnp.where(turns, drive, 0.0), jnp.where(turns, decay, 0.0), turns)

    def _unheld(self, wheels: "AbstractWheels", drive: OfEach) -> tuple[OfEach, OfEach]:
        if wheels.coulomb_friction is not None:
            drive = drive + wheels.coulomb_friction * self.side
        return drive, wheels.decay + jnp.zeros_like(drive)

    def margins(
        self, wheels: "AbstractWheels", momentum: OfEach, drive: OfEach, drag: OfEach
    ) -> Float[Array, "2 wheels"]:
        """Return the margin of each wheel's state: below zero for a wheel that has left it.

        The first row is for rest and holds, the second for the momentum limit. In N m s for turning
        wheels, in N m for others; `drag` (N m) is J_w a·dω/dt.
        """
        torque, decay = self._unheld(wheels, drive)
        slowing = torque + decay * momentum + drag
        never = jnp.full_like(momentum, jnp.inf)
        at_limit = jnp.where(self.limited, -slowing * jnp.sign(momentum), never)
        first, second = at_limit, never
        if wheels.coulomb_friction is not None:
            friction = wheels.coulomb_friction
            passes = jnp.maximum(self.side * momentum, -slowing * self.side)
            rubs = self.turns & (friction > 0) & (self.side != 0)
            first = jnp.where(rubs, passes, at_limit)
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
        self, wheels: "AbstractWheels", momentum: OfEach, margins: Float[Array, "2 wheels"]
    ) -> OfEach:
        """Return momenta (N m s), exactly zero or the limit for wheels that reached it."""
        first, second = margins < 0
        if wheels.momentum_limit is not None:
            limit = wheels.momentum_limit
            limit = jnp.where(jnp.isfinite(limit), limit, 0.0)
            momentum = jnp.where(second, jnp.sign(momentum) * limit, momentum)
        return jnp.where(first & self.turns, 0.0, momentum)


class AbstractWheels(AbstractEffector):
    """Motors, friction and modes of wheels; see `jaxsat.spacecraft.wheels.Wheels`."""

    axes: eqx.AbstractVar[Float[Array, "3 wheels"]]
    torque_limit: eqx.AbstractVar[OfEach | None]
    momentum_limit: eqx.AbstractVar[OfEach | None]
    rotor_inertia: eqx.AbstractVar[OfEach | None]
    viscous_friction: eqx.AbstractVar[OfEach | None]
    coulomb_friction: eqx.AbstractVar[OfEach | None]
    limited: eqx.AbstractVar[Bool[Array, " wheels"] | None]
    seized: eqx.AbstractVar[Bool[Array, " wheels"] | None]

    @property
    def count(self) -> int:
        """Number of wheels."""
        return self.axes.shape[1]

    @property
    def decay(self) -> Float[Array, " wheels"]:
        """Relative decay of momenta by viscous friction, b / J_w, 1/s."""
        if self.viscous_friction is None or self.rotor_inertia is None:
            return jnp.zeros(self.count)
        inertia = jnp.where(self.rotor_inertia > 0, self.rotor_inertia, 1.0)
        return self.viscous_friction / inertia

    def motor_torque(self, command: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """Return the motor torques for a command, N m, without friction and momentum limit."""
        if self.torque_limit is None:
            return command
        return jnp.clip(command, -self.torque_limit, self.torque_limit)

    def _drag(self, acceleration: Vector) -> Float[Array, " wheels"]:
        if self.rotor_inertia is None:
            return jnp.zeros(self.count, acceleration.dtype)
        return self.rotor_inertia * (self.axes.T @ acceleration)

    def free_inertia(self, turns: Bool[Array, " wheels"] | None = None) -> Matrix | None:
        """Return the correction of the inertia by turning wheels, by default all, -Σ J_w a aᵀ,
        kg m²; None without a rotor inertia."""
        if self.rotor_inertia is None:
            return None
        inertia = self.rotor_inertia if turns is None else jnp.where(turns, self.rotor_inertia, 0.0)
        return -(self.axes @ (inertia[:, None] * self.axes.T))

    @property
    def mode_passes(self) -> int:
        """Number of calls of `mode_after`: zero if `limited` holds the wheels."""
        if self.limited is not None:
            return 0
        return 1 if self.rotor_inertia is None else STATE_PASSES

    def mode(self, state: WheelMomenta) -> WheelStates:
        """Return the wheels' mode by their momenta alone, held wherever possible."""
        momentum = state.momentum
        never = jnp.zeros_like(momentum) > 0
        rests = limited = never
        if self.coulomb_friction is not None:
            rests = (momentum == 0) & (self.coulomb_friction > 0)
        if self.seized is not None:
            rests = rests | self.seized
        if self.limited is not None:
            limited = self.limited & ~rests
        elif self.momentum_limit is not None:
            limited = (jnp.abs(momentum) >= self.momentum_limit) & ~rests
        return WheelStates(jnp.sign(momentum), rests, limited)

    def mode_after(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> WheelStates:
        """Return the mode after wheels with a margin below zero have left their state."""
        if self.limited is not None:
            return mode
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.left(mode.margins(self, state.momentum, drive, drag), drive, drag)

    def piece(self, mode: WheelStates, command: Float[Array, " wheels"]) -> WheelPiece:
        """Return the drive and decay of each wheel, and which of them turn."""
        return mode.piece(self, self.motor_torque(command))

    def _rate(self, piece: WheelPiece, state: WheelMomenta, acceleration):
        rate = -piece.torque(state.momentum)
        if self.rotor_inertia is None:
            return rate
        rate = rate - self._drag(acceleration)
        return rate if piece.turns is None else jnp.where(piece.turns, rate, 0.0)
