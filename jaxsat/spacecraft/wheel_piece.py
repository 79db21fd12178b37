"""The torque of wheels between two instants at which it jumps, and times until such instants."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

SMALL = 1e-4
"""Below this -log(1 - x)/x is taken from its series, whose next term is x⁵/6."""


class WheelPiece(NamedTuple):
    """Wheels between two edges: the torque of those that turn is drive + decay h on the body, N m.

    `drive` in N m and `decay` in 1/s, of shape (wheels,), stay while the command does. `turns`
    tells which wheels do not keep their momentum relative to the body; None for wheels without a
    rotor inertia, of which those that keep it make no torque.
    """

    drive: Float[Array, " wheels"]
    decay: Float[Array, " wheels"]
    turns: Bool[Array, " wheels"] | None = None

    def torque(self, momentum: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """The torque of motor and friction along each axis, N m, at these momenta, N m s.

        Zero for wheels that do not turn.
        """
        return self.drive + self.decay * momentum


def time_to(target, begin, piece: WheelPiece) -> Float[Array, " wheels"]:
    """Seconds until momenta come from `begin` to `target`, ahead of them; infinite for never.

    None are left to a target that is behind them by rounding.
    """
    speed = -piece.torque(begin)
    moves = (speed != 0) & jnp.isfinite(target)
    distance = jnp.where(moves, target - begin, 0.0)
    straight = jnp.maximum(distance / jnp.where(moves, speed, 1.0), 0.0)
    share = piece.decay * straight  # of the way to where friction alone would stop them
    reached = moves & (share < 1)
    return jnp.where(reached, straight * _log_ratio(jnp.where(reached, share, 0.0)), jnp.inf)


def _log_ratio(x: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
    """-log(1 - x) / x for x in [0, 1), 1 at zero."""
    series = 1 + x * (1 / 2 + x * (1 / 3 + x * (1 / 4 + x / 5)))
    small = x < SMALL
    away = jnp.where(small, 0.5, x)
    return jnp.where(small, series, -jnp.log1p(-away) / away)
