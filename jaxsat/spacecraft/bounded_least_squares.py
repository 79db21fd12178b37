"""Torques of devices within their bounds, with the least sum of squares, that make a torque.

The parametric active-set method (Best, An algorithm for the solution of the parametric quadratic
programming problem, 1996) for three equations, in plain `jax.numpy`. The torque on the body grows
from zero, and the solution is optimal all the way. Until a device comes to a bound it is that
without bounds; then others make up for it, until it leaves its bound or the next one comes to its
own. Where none can, that is as much of the torque as can be made in its direction.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.core.smooth import within
from jaxsat.spacecraft.least_propellant import inverse_of_columns, part_up_to

OfEach = Float[Array, " m"]

ROUNDS_A_DEVICE = 8
"""The method ends after so many rounds for each device; it needs one or two. None comes twice."""

FLAT = 1e-9
"""Of unit columns: what of one is across others is none."""

NONE = 1e-11
"""Of a torque: what is below counts as zero."""

BEYOND = 1e-10
"""Of a torque: where a device comes to its bound within so much more, it counts as being there."""


class Bounded(NamedTuple):
    """Devices along `units`, with torques from `low` to `high` and a `weight` in the squares."""

    units: Float[Array, "3 m"]
    low: OfEach
    high: OfEach
    weight: OfEach


class Active(NamedTuple):
    """Which devices are at a bound: those with a `side` of 1 at the upper one, -1 at the lower one.

    The torques of all others are W Aᵀμ, with A the `units`, W the `weight`, and μ the `multiplier`.
    `ahead` is still to be made by way of this `leg`: 0 comes first, 1 is the torque itself. A leg
    that was not made in full has in its row of `facets` the normal of what ended it.
    """

    multiplier: Float[Array, "3"]
    side: OfEach
    ahead: Float[Array, "3"]
    facets: Float[Array, "2 3"]
    leg: Int[Array, ""]
    rounds: Int[Array, ""]
    goes: Bool[Array, ""]


def least_squares_within(
    units: Float[Array, "3 m"],
    low: OfEach,
    high: OfEach,
    torque: Float[Array, "3"],
    first: Float[Array, "3"],
) -> tuple[OfEach, Float[Array, "3"]]:
    """Torques u along `units`, `low` <= u <= `high`, that make `first` + `torque`, all in N m.

    Bounds have zero between them. Where the sum is too much, `first` is made as far as it can be;
    then, of what the sum lacks, the greatest part in its direction. Of all that make this the one
    with the least Σ (u / limit)² is given, the limit of each the larger one of its bounds, and what
    is not made. A device without bounds counts as one with the largest limit of the others.
    """
    limit = jnp.maximum(high, -low)
    known = jnp.where(jnp.isfinite(limit), limit, 0.0)
    largest = jnp.max(known)
    size = jax.lax.stop_gradient(jnp.where(largest > 0, largest, 1.0))
    strength = jax.lax.stop_gradient(jnp.where(jnp.isfinite(limit), known / size, 1.0))
    devices = Bounded(units, low / size, high / size, strength**2)
    made, unmade = _solved(devices, torque / size, first / size)
    return within(size * made, low, high), size * unmade


def _solved(
    devices: Bounded, torque: Float[Array, "3"], first: Float[Array, "3"]
) -> tuple[OfEach, Float[Array, "3"]]:
    """At the last set of devices at their bounds, where all derivatives are.

    A device that is just at its bound counts as being there, as it is for a torque slightly
    `BEYOND`, where the others can make up for that.
    """
    fixed = jax.lax.stop_gradient((devices, torque, first))
    last = _ended(*fixed[:2], _beginning(*fixed))
    beyond = _ended(*fixed[:2], _continued(last, fixed[1] + fixed[2]))
    each, made = _at(*fixed, beyond)
    off = made - devices.units @ within(each, devices.low, devices.high)
    good = jnp.max(jnp.abs(off)) <= NONE * jnp.max(jnp.abs(made))
    chosen = jax.tree.map(lambda x, y: jnp.where(good, x, y), beyond, last)
    each, made = _at(devices, torque, first, chosen)
    return each, torque + first - made


def _at(
    devices: Bounded, torque: Float[Array, "3"], first: Float[Array, "3"], at: Active
) -> tuple[OfEach, Float[Array, "3"]]:
    """Torques of each with these devices at their bounds, and what all are to make together."""
    free = _free(devices, at)
    low, high = (jnp.where(jnp.isfinite(x), x, 0.0) for x in (devices.low, devices.high))
    bounds = (low, high)
    made = part_up_to(at.facets[0], devices.units, bounds, 0 * first, first)
    made = made + part_up_to(at.facets[1], devices.units, bounds, made, torque + first - made)
    each = jnp.where(at.side > 0, devices.high, jnp.where(at.side < 0, devices.low, 0.0))
    inverse = _inverse(devices, free, _span(devices, free))
    for _ in range(3):  # the second and third take away what rounding has left
        lacks = made - devices.units @ each
        each = each + jnp.where(free, devices.weight * ((inverse @ lacks) @ devices.units), 0.0)
    return each, made


def _beginning(devices: Bounded, torque: Float[Array, "3"], first: Float[Array, "3"]) -> Active:
    """No torque, and all of it ahead."""
    comes_first = jnp.any(first != 0)
    none = jnp.zeros_like(torque)
    return Active(
        none,
        0 * devices.weight,
        jnp.where(comes_first, first, torque),
        jnp.stack([none, none]),
        jnp.where(comes_first, 0, 1),
        jnp.array(0),
        comes_first | jnp.any(torque != 0),
    )


def _continued(last: Active, torque: Float[Array, "3"]) -> Active:
    """On a little in the direction of all that is to be made, unless no more could be made."""
    return last._replace(
        ahead=BEYOND * torque,
        rounds=jnp.array(0),
        leg=jnp.array(1),
        goes=jnp.all(last.facets == 0) & jnp.any(torque != 0),
    )


def _ended(devices: Bounded, torque: Float[Array, "3"], at: Active) -> Active:
    """After all rounds."""
    return jax.lax.while_loop(
        lambda at: at.goes & (at.rounds < ROUNDS_A_DEVICE * (devices.low.shape[0] + 1)),
        lambda at: _round(devices, torque, at),
        at,
    )


def _free(devices: Bounded, at: Active) -> Bool[Array, " m"]:
    """The devices that are not at a bound."""
    return (at.side == 0) & (devices.high > devices.low)


def _span(devices: Bounded, free: Bool[Array, " m"]) -> Float[Array, "3 3"]:
    """The projector on the torques that these make together; the identity where they make all."""
    across = devices.units
    span = jnp.zeros((3, 3), across.dtype)
    for _ in range(3):
        sizes = jnp.where(free, jnp.sum(across**2, axis=0), 0.0)
        most = jnp.argmax(jax.lax.stop_gradient(sizes * devices.weight))
        there = sizes[most] > FLAT**2
        one = across[:, most] / jnp.sqrt(jnp.where(there, sizes[most], 1.0))
        one = jnp.where(there, one, 0.0)
        span = span + jnp.outer(one, one)
        across = across - jnp.outer(one, one @ across)
    whole = jax.lax.stop_gradient(jnp.trace(span)) > 2.5
    return jnp.where(whole, jnp.eye(3, dtype=span.dtype), span)


def _inverse(
    devices: Bounded, free: Bool[Array, " m"], span: Float[Array, "3 3"]
) -> Float[Array, "3 3"]:
    """Of A W Aᵀ on what these devices span, with any number across it."""
    gram = (jnp.where(free, devices.weight, 0.0)[None] * devices.units) @ devices.units.T
    size = jax.lax.stop_gradient(jnp.trace(gram))
    size = jnp.where(size > 0, size, 1.0)
    return inverse_of_columns(gram / size + jnp.eye(3, dtype=gram.dtype) - span) / size


def _round(devices: Bounded, torque: Float[Array, "3"], at: Active) -> Active:
    """On to where a device comes to a bound or leaves it, or the leg ends.

    Where the free devices do not make what is ahead, the multiplier alone changes, across all that
    they make, until one at a bound leaves it; if none does, no more can be made.
    """
    free = _free(devices, at)
    span = _span(devices, free)
    across = at.ahead - span @ at.ahead
    square = jnp.sum(across**2)
    stands = square > NONE**2 * jnp.sum(at.ahead**2)
    across = across / jnp.sqrt(jnp.where(stands, square, 1.0))
    way = jnp.where(stands, across, _inverse(devices, free, span) @ at.ahead)
    along = way @ devices.units
    rate = devices.weight * along
    now = devices.weight * (at.multiplier @ devices.units)
    pace = jnp.sqrt(devices.weight) * jnp.abs(along)
    moves = pace > NONE * jnp.max(pace)
    side = jnp.where(rate < 0, -1.0, 1.0)
    comes = free & moves & ~stands
    leaves = (at.side * side < 0) & moves
    ahead_of_bound = jnp.where(rate < 0, now - devices.low, devices.high - now)
    beyond = jnp.where(at.side < 0, devices.low - now, now - devices.high)
    room = jnp.maximum(jnp.where(free, ahead_of_bound, beyond), 0.0)
    until = room / jnp.where(moves, jnp.abs(rate), 1.0)
    until = jnp.where(comes | leaves, until, jnp.inf)
    step, hit = jnp.min(until), jnp.argmin(until)
    short = stands & ~jnp.isfinite(step)
    ended = short | (~stands & (step >= 1 - NONE))
    step = jnp.where(stands, jnp.where(short, 0.0, step), jnp.minimum(step, 1.0))
    turned = (jnp.arange(free.shape[0]) == hit) & ~ended
    left = jnp.where(stands, at.ahead, (1 - step) * at.ahead)
    this = ended & (jnp.arange(2) == at.leg)
    return Active(
        at.multiplier + step * way,
        jnp.where(turned, jnp.where(free, side, 0.0), at.side),
        jnp.where(ended, torque + left, left),
        jnp.where(this[:, None], jnp.where(short, across, 0.0)[None], at.facets),
        jnp.where(ended, at.leg + 1, at.leg),
        at.rounds + 1,
        ~ended | (at.leg == 0),
    )
