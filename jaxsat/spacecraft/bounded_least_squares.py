"""Torques of wheels within their limits, nearest to those that least squares give.

The parametric active-set method (Best, An algorithm for the solution of the parametric quadratic
programming problem, 1996) for three equations, in plain `jax.numpy`. The torque on the body grows
from zero. Until a wheel comes to its limit the solution is that without limits; then others make
up for it, until it leaves its limit or the next one comes to its own.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.core.smooth import within

RealScalar = Float[Array, ""]
OfEach = Float[Array, " m"]

ROUNDS_A_WHEEL = 8
"""The method ends after so many rounds for each wheel; it needs one or two. None comes twice."""

FLAT = 1e-9
"""Of unit axes: what of one is across others is none."""

NONE = 1e-11
"""Of a torque: what is below counts as zero."""


class Shared(NamedTuple):
    """Torques (N m) of wheels, what they are bounded by, and which of them are at a bound.

    The solution is s `wanted` + W Aᵀμ within `limit`, A the `axes`, W the `weight`, s the `part`
    of the torque that is made so far, `multiplier` μ. `side` is 1 or -1 for a wheel at its limit,
    0 for others. It `goes` on until all is made or, where it is `short`, no more can be.
    """

    part: RealScalar
    multiplier: Float[Array, "3"]
    side: OfEach
    short: Bool[Array, ""]
    goes: Bool[Array, ""]
    rounds: Int[Array, ""]


class Wheeling(NamedTuple):
    """What is shared: see `Shared`."""

    axes: Float[Array, "3 m"]
    weight: OfEach
    limit: OfEach
    wanted: OfEach


def nearest_within(
    axes: Float[Array, "3 m"], weight: OfEach, limit: OfEach, wanted: OfEach
) -> tuple[OfEach, RealScalar]:
    """Torques u within |u| <= `limit` (N m) that make the torque of those `wanted`.

    They minimise Σ (u - s wanted)² / `weight` subject to A u = s A wanted, for the greatest part s
    up to 1; returned are u and s. A wheel without a limit or a weight makes nothing. `axes` are
    unit columns.
    """
    used = (limit > 0) & (weight > 0)
    size = jnp.max(jnp.where(used, limit, 0.0))
    size = jax.lax.stop_gradient(jnp.where(size > 0, size, 1.0))
    heaviest = jax.lax.stop_gradient(jnp.max(jnp.where(used, weight, 0.0)))
    given = Wheeling(
        axes,
        jnp.where(used, weight, 0.0) / jnp.where(heaviest > 0, heaviest, 1.0),
        jnp.where(used, limit, 0.0) / size,
        jnp.where(used, wanted, 0.0) / size,
    )
    found, part = _solved(given)
    fits = jnp.all(jnp.abs(given.wanted) <= given.limit)
    found = within(size * found, -limit, limit)
    return jnp.where(fits, jnp.where(used, wanted, 0.0), found), jnp.where(fits, 1.0, part)


def _solved(given: Wheeling) -> tuple[OfEach, RealScalar]:
    """At the last set of wheels at their limits, where all derivatives are."""
    fixed = jax.lax.stop_gradient(given)
    count = given.limit.shape[0]
    torque = fixed.axes @ fixed.wanted
    start = Shared(
        0 * torque[0],
        0 * torque,
        0 * fixed.limit,
        jnp.array(False),
        jnp.any(jnp.abs(fixed.wanted) > fixed.limit) & jnp.any(jnp.abs(torque) > 0),
        jnp.array(0),
    )
    last = jax.lax.while_loop(
        lambda at: at.goes & (at.rounds < ROUNDS_A_WHEEL * count),
        lambda at: _round(fixed, at),
        start,
    )
    free = _free(given, last)
    span = _span(given, free)
    torque = given.axes @ given.wanted
    normal = torque - span @ torque
    speed = normal @ torque
    bound = last.side * given.limit
    farthest = (normal @ given.axes) @ bound
    part = jnp.where(last.short, farthest / jnp.where(last.short, speed, 1.0), last.part)
    made = bound + jnp.where(free, part * given.wanted, 0.0)
    inverse = _inverse(given, free, span)
    for _ in range(3):  # the second and third take away what rounding has left
        lacks = part * torque - given.axes @ made
        made = made + jnp.where(free, given.weight * ((inverse @ lacks) @ given.axes), 0.0)
    return made, part


def _free(given: Wheeling, at: Shared) -> Bool[Array, " m"]:
    """The wheels that are not at a limit."""
    return (at.side == 0) & (given.limit > 0)


def _span(given: Wheeling, free: Bool[Array, " m"]) -> Float[Array, "3 3"]:
    """The projector on the torques that wheels make together; the identity where they make all."""
    across = given.axes
    span = jnp.zeros((3, 3), across.dtype)
    for _ in range(3):
        sizes = jnp.where(free, jnp.sum(across**2, axis=0), 0.0)
        most = jnp.argmax(jax.lax.stop_gradient(sizes * given.weight))
        there = sizes[most] > FLAT**2
        one = across[:, most] / jnp.sqrt(jnp.where(there, sizes[most], 1.0))
        one = jnp.where(there, one, 0.0)
        span = span + jnp.outer(one, one)
        across = across - jnp.outer(one, one @ across)
    whole = jax.lax.stop_gradient(jnp.trace(span)) > 2.5
    return jnp.where(whole, jnp.eye(3, dtype=span.dtype), span)


def _inverse(
    given: Wheeling, free: Bool[Array, " m"], span: Float[Array, "3 3"]
) -> Float[Array, "3 3"]:
    """Of A W Aᵀ on what these wheels span, with any number across it."""
    gram = (jnp.where(free, given.weight, 0.0)[None] * given.axes) @ given.axes.T
    size = jax.lax.stop_gradient(jnp.trace(gram))
    size = jnp.where(size > 0, size, 1.0)
    a, b, c = gram / size + jnp.eye(3, dtype=gram.dtype) - span
    across = jnp.cross(b, c)
    adjugate = jnp.stack([across, jnp.cross(c, a), jnp.cross(a, b)])
    return adjugate / (jnp.sum(a * across) * size)


def _round(given: Wheeling, at: Shared) -> Shared:
    """On to where a wheel comes to its limit or leaves it, or all is made.

    Where the free wheels do not make what those at their limits leave, the multiplier alone
    changes, across all that they make, until one leaves its limit; if none does, all others push
    as far as they can, and no more can be made.
    """
    free = _free(given, at)
    torque = given.axes @ given.wanted
    lacks = given.axes @ jnp.where(free, 0.0, given.wanted)
    span = _span(given, free)
    across = lacks - span @ lacks
    stands = jnp.sum(across**2) > NONE**2 * jnp.sum(torque**2)
    way = jnp.where(stands, across, _inverse(given, free, span) @ lacks)
    rate = given.weight * (way @ given.axes) + jnp.where(stands, 0.0, given.wanted)
    now = given.weight * (at.multiplier @ given.axes) + at.part * given.wanted
    speed, side = jnp.abs(rate), jnp.where(rate < 0, -1.0, 1.0)
    moves = speed > NONE * jnp.max(speed)
    comes = free & moves & ~stands
    leaves = (at.side * side < 0) & moves
    room = jnp.where(free, given.limit - side * now, jnp.abs(now) - given.limit)
    until = jnp.maximum(room, 0.0) / jnp.where(moves, speed, 1.0)
    until = jnp.where(comes | leaves, until, jnp.inf)
    step, hit = jnp.min(until), jnp.argmin(until)
    short = stands & ~jnp.isfinite(step)
    ends = short | (~stands & (at.part + step >= 1))
    step = jnp.where(stands, jnp.where(short, 0.0, step), jnp.minimum(step, 1 - at.part))
    turned = (jnp.arange(free.shape[0]) == hit) & ~ends
    return Shared(
        jnp.where(ends & ~short, 1.0, at.part + jnp.where(stands, 0.0, step)),
        at.multiplier + step * way,
        jnp.where(turned, jnp.where(free, side, 0.0), at.side),
        short,
        ~ends,
        at.rounds + 1,
    )
