"""Wheels whose rotors have an inertia: how each moves, and for how long.

What changes the momentum of a wheel is then also the drag J_w a·dω/dt of a body that turns faster:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

So a wheel at rest is held by Coulomb friction up to |c + J_w a·dω/dt| = τ, one at the limit of its
momentum is held until both together slow it down, and held wheels turn with the body as if locked.
"""

from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.spacecraft.wheel_piece import WheelPiece

if TYPE_CHECKING:
    from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " wheels"]


class WheelStates(NamedTuple):
    """How each wheel moves: whether it `rests`, is `limited` to the momentum it has, or turns.

    `side` is the sign of its Coulomb friction, zero where it rests or turns about zero.
    """

    side: OfEach
    rests: Bool[Array, " wheels"]
    limited: Bool[Array, " wheels"]

    @property
    def turns(self) -> Bool[Array, " wheels"]:
        """Which wheels do not keep their momentum relative to the body."""
        return ~(self.rests | self.limited)

    def piece(self, wheels: "Wheels", drive: OfEach) -> WheelPiece:
        """The torque of `wheels` in these states whose motors make the torques `drive` (N m)."""
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
        """How far each wheel is from leaving its state: below zero for one that has left it.

        The first row belongs to rest and to what is held, the second to the limit of momentum. In
        N m s for wheels that turn, in N m for others; `drag` (N m) is J_w a·dω/dt.
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
        """The states after those of which a margin is below zero.

        A wheel that comes to zero rests, if only until its own margin is asked.
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
        """Momenta (N m s) that are exactly zero, or the limit, where wheels have come to it."""
        first, second = margins < 0
        if wheels.momentum_limit is not None:
            limit = wheels.momentum_limit
            limit = jnp.where(jnp.isfinite(limit), limit, 0.0)
            momentum = jnp.where(second, jnp.sign(momentum) * limit, momentum)
        return jnp.where(first & self.turns, 0.0, momentum)


def first_states(wheels: "Wheels", momentum: OfEach) -> WheelStates:
    """The states of wheels by their momenta (N m s) alone: those that may be held are."""
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
