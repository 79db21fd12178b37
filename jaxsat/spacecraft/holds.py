"""Holds: the times between two samples in which no command of an effector changes."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

RealScalar = Float[Array, ""]


class Hold(NamedTuple):
    """A time in a period during which commands of effectors stay.

    `begin` and `length` are in s, `begin` from the sample on. `pieces` are those that the effectors
    of the body are in.
    """

    begin: RealScalar
    length: RealScalar
    pieces: tuple[PyTree, ...] = ()

    def part(self, elapsed: RealScalar, length: RealScalar) -> "Hold":
        """The part that begins `elapsed` seconds after the begin, of this length (s)."""
        return self._replace(begin=self.begin + elapsed, length=length)


def hold_by_hold(count: int, period: RealScalar, step: Callable[..., tuple], *carry: PyTree):
    """The carry after `step` for each of at most `count` holds of a period (s).

    A step takes the instant (s from the sample) at which a hold begins and the carry, and gives
    those at its end. A period seldom has as many holds as it may have. Those left are skipped where
    an engine can, and the loop can be differentiated either way.
    """
    first = (jnp.zeros_like(period), *carry)
    if count == 1:
        return step(*first)[1:]

    def one(_, now):
        return jax.lax.cond(now[0] < period, lambda now: step(*now), lambda now: now, now)

    return jax.lax.fori_loop(0, count, one, first)[1:]


def mean_size(first: Float[Array, "3"], last: Float[Array, "3"]) -> Float[Array, "3"]:
    """The mean size about each axis of a torque (N m) that changes evenly from one to another."""
    both = jnp.abs(first) + jnp.abs(last)
    crossing = (first**2 + last**2) / jnp.where(both > 0, 2 * both, 1.0)
    return jnp.where(first * last < 0, crossing, both / 2)
