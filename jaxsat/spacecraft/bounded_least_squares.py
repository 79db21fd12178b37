"""Bounded least squares: torques of devices that make a torque with the least sum of squares.

The parametric active-set method (Best, An algorithm for the solution of the parametric quadratic
programming problem, 1996) for three equations, in plain `jax.numpy`. The torque on the body grows
from zero, and the solution is optimal all the way. Until a device reaches a bound, the solution is
the unbounded one; then others make up for it, until it leaves its bound or the next one reaches its
own. Where no other device can, the result is the greatest part of the torque in its direction.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.smooth import within
from jaxsat.spacecraft.torque_legs import begun_legs, legs_before, parts_up_to

OfEach = Float[Array, " m"]

ROUNDS_A_DEVICE = 8
"""Largest number of rounds per device; the method needs one or two, and no active set recurs."""

FLAT = 1e-9
"""Tolerance on the component of a unit column across others, below which it is zero."""

NONE = 1e-11
"""Relative tolerance below which a torque is zero."""

BEYOND = 1e-10
"""Relative increase of the torque within which a device that reaches its bound counts as there."""


class Bounded(NamedTuple):
    """Devices along `units`: torques from `low` to `high`, and `weight` of each in the squares."""

    units: Float[Array, "3 m"]
    low: OfEach
    high: OfEach
    weight: OfEach


class ActiveSet(NamedTuple):
    """Active constraints of a solution: the devices at a bound, and the facets that ended legs.

    Devices with a `side` of 1 are at their upper bound, those with -1 at the lower one. A leg that
    was not made in full, see `Active`, has in its row of `facets` the normal of the facet that
    ended it; there is no row for a first torque if none comes first.
    """

    side: OfEach
    facets: Float[Array, "legs 3"]


class Active(NamedTuple):
    """State of the method: the torques of all devices that are not in `active` are W Aᵀμ, with A
    the `units`, W the `weight`, and μ the `multiplier`.

    `ahead` is the torque still to be made by this `leg`: 0 is the first torque, 1 the torque
    itself, and 2 a small increase `BEYOND`. `last` is the active set at the end of the torque.
    """

    multiplier: Vector
    active: ActiveSet
    last: ActiveSet
    ahead: Vector
    leg: IntScalar
    rounds: IntScalar
    goes: BoolScalar


@jax.jit
def least_squares_within(
    units: Float[Array, "3 m"],
    low: OfEach,
    high: OfEach,
    torque: Vector,
    first: Vector | None = None,
) -> tuple[OfEach, Vector]:
    """Compute torques u along `units`, `low` <= u <= `high`, that make `first` + `torque` (N m).

    Bounds include zero. Where the sum is out of reach, `first` (None is zero) is made as far as
    possible; then the greatest part of the rest in its direction. Among all such torques the result
    has the least Σ (u / limit)², with the larger of a device's bounds as its limit. An unbounded
    device has the largest limit of the others. Returns u and the torque that is not made.
    """
    limit = jnp.maximum(high, -low)
    finite = jnp.where(jnp.isfinite(limit), limit, 0.0)
    largest = jnp.max(finite)
    size = jax.lax.stop_gradient(jnp.where(largest > 0, largest, 1.0))
    strength = jax.lax.stop_gradient(jnp.where(jnp.isfinite(limit), finite / size, 1.0))
    devices = Bounded(units, low / size, high / size, strength**2)
    torques, unmade = _solved(devices, torque / size, None if first is None else first / size)
    return within(size * torques, low, high), size * unmade


def _solved(devices: Bounded, torque: Vector, first: Vector | None) -> tuple[OfEach, Vector]:
    """Return the solution at the last active set, at which all derivatives are taken.

    A device just at its bound counts as held if it is so for a torque slightly `BEYOND`, where the
    other devices can make up for it.
    """
    end = _ended(*jax.lax.stop_gradient((devices, torque, first)))
    both = jax.tree.map(lambda *x: jnp.stack(x), end.active, end.last)

    def tried(active: ActiveSet):
        each, totals = _at(devices, torque, first, active)
        off = totals - devices.units @ within(each, devices.low, devices.high)
        return each, totals, jnp.max(jnp.abs(off)) <= NONE * jnp.max(jnp.abs(totals))

    def one_more(so_far, active: ActiveSet):
        return jax.lax.cond(so_far[-1], lambda: so_far, lambda: tried(active)), None

    none = (jnp.zeros_like(devices.weight), jnp.zeros_like(torque), jnp.array(False))
    (each, totals, _), _ = jax.lax.scan(one_more, none, both)
    return each, (torque if first is None else torque + first) - totals


def _at(
    devices: Bounded, torque: Vector, first: Vector | None, active: ActiveSet
) -> tuple[OfEach, Vector]:
    """Return the torque of each device with this active set, and the torque of all together."""
    free = _free(devices, active)
    low, high = (jnp.where(jnp.isfinite(x), x, 0.0) for x in (devices.low, devices.high))
    bounds = (low, high)
    total = parts_up_to(active.facets, devices.units, bounds, torque, first)
    inverse = _inverse(devices, free, _basis(devices, free))

    def nearer(_, each: OfEach) -> OfEach:
        lacks = total - devices.units @ each
        return each + jnp.where(free, devices.weight * ((inverse @ lacks) @ devices.units), 0.0)

    at_bounds = jnp.where(active.side > 0, high, jnp.where(active.side < 0, low, 0.0))
    # The second and third pass remove round-off.
    return jax.lax.fori_loop(0, 3, nearer, at_bounds), total


def _beginning(devices: Bounded, torque: Vector, first: Vector | None) -> Active:
    """Return the initial state: no torque made, all of it ahead."""
    facets, ahead, leg = begun_legs(torque, first)
    active = ActiveSet(jnp.zeros_like(devices.weight), facets)
    comes_first = False if first is None else jnp.any(first != 0)
    return Active(
        jnp.zeros_like(torque),
        active,
        active,
        ahead,
        leg,
        jnp.array(0),
        comes_first | jnp.any(torque != 0),
    )


def _ended(devices: Bounded, torque: Vector, first: Vector | None) -> Active:
    return jax.lax.while_loop(
        lambda at: at.goes & (at.rounds < ROUNDS_A_DEVICE * (devices.low.shape[0] + 1)),
        lambda at: _round(devices, torque, first, at),
        _beginning(devices, torque, first),
    )


def _free(devices: Bounded, active: ActiveSet) -> Bool[Array, " m"]:
    return (active.side == 0) & (devices.high > devices.low)


def _basis(devices: Bounded, free: Bool[Array, " m"]) -> Matrix:
    """Return an orthonormal basis, as rows, of the torques of the free devices, that of the
    strongest first; rows beyond its rank are zero."""

    def with_one_more(row, so_far):
        basis, across = so_far
        sizes = jnp.where(free, jnp.sum(across**2, axis=0), 0.0)
        most = jnp.argmax(jax.lax.stop_gradient(sizes * devices.weight))
        largest = jnp.arange(sizes.shape[0]) == most
        size = jnp.sum(jnp.where(largest, sizes, 0.0))
        independent = size > FLAT**2
        one = jnp.sum(jnp.where((largest & independent)[None], across, 0.0), axis=1)
        one = one / jnp.sqrt(jnp.where(independent, size, 1.0))
        place = jnp.where(jnp.arange(3) == row, 1.0, 0.0)
        return basis + jnp.outer(place, one), across - jnp.outer(one, one @ across)

    none = jnp.zeros((3, 3), devices.units.dtype)
    return jax.lax.fori_loop(0, 3, with_one_more, (none, devices.units))[0]


def _span(basis: Matrix, devices: int) -> Matrix:
    """Return the projector onto the span of the `basis` of so many devices, exactly the identity
    for full rank."""
    span = basis.T @ basis
    if devices < 3:
        return span
    whole = jax.lax.stop_gradient(jnp.trace(span)) > 2.5
    return jnp.where(whole, jnp.eye(3, dtype=span.dtype), span)


def _inverse(devices: Bounded, free: Bool[Array, " m"], basis: Matrix) -> Matrix:
    """Return the inverse of A W Aᵀ on the span of the free devices, zero across it.

    A W Aᵀ = L D Lᵀ in their `basis`, strong devices first, keeps the digits of weak devices, which
    cofactors lose.
    """
    along = basis @ devices.units
    gram = (jnp.where(free, devices.weight, 0.0)[None] * along) @ along.T
    first = _reciprocal(gram[0, 0])
    second = _reciprocal(gram[1, 1] - first * gram[0, 1] ** 2)
    mixed = gram[1, 2] - first * gram[0, 1] * gram[0, 2]
    third = _reciprocal(gram[2, 2] - first * gram[0, 2] ** 2 - second * mixed**2)
    one = basis[0]
    two = basis[1] - first * gram[0, 1] * one
    three = basis[2] - first * gram[0, 2] * one - second * mixed * two
    return (
        first * jnp.outer(one, one) + second * jnp.outer(two, two) + third * jnp.outer(three, three)
    )


def _reciprocal(pivot: RealScalar) -> RealScalar:
    """Return 1 / x, and zero unless x is positive."""
    there = pivot > 0
    return jnp.where(there, 1 / jnp.where(there, pivot, 1.0), 0.0)


def _round(devices: Bounded, torque: Vector, first: Vector | None, at: Active) -> Active:
    """Advance to where a device reaches a bound or leaves it, or the leg ends.

    Where the free devices cannot make the torque ahead, only the multiplier changes, across their
    span, until a device leaves its bound; if none does, no more torque can be made.
    """
    free = _free(devices, at.active)
    basis = _basis(devices, free)
    span = _span(basis, free.shape[0])
    across = at.ahead - span @ at.ahead
    square = jnp.sum(across**2)
    stands = square > NONE**2 * jnp.sum(at.ahead**2)
    across = across / jnp.sqrt(jnp.where(stands, square, 1.0))
    across = across - span @ across  # removes the round-off of a small one
    way = jnp.where(stands, across, _inverse(devices, free, basis) @ at.ahead)
    along = way @ devices.units
    along = jnp.where(stands & (jnp.abs(along) <= FLAT), 0.0, along)
    rate = devices.weight * along
    now = devices.weight * (at.multiplier @ devices.units)
    pace = jnp.sqrt(devices.weight) * jnp.abs(along)
    moves = pace > NONE * jnp.max(pace)
    side = jnp.where(rate < 0, -1.0, 1.0)
    comes = free & moves & ~stands
    leaves = (at.active.side * side < 0) & moves
    ahead_of_bound = jnp.where(rate < 0, now - devices.low, devices.high - now)
    beyond = jnp.where(at.active.side < 0, devices.low - now, now - devices.high)
    room = jnp.maximum(jnp.where(free, ahead_of_bound, beyond), 0.0)
    until = room / jnp.where(moves, jnp.abs(rate), 1.0)
    until = jnp.where(comes | leaves, until, jnp.inf)
    step, hit = jnp.min(until), jnp.argmin(until)
    short = stands & ~jnp.isfinite(step)
    ended = short | (~stands & (step >= 1 - NONE))
    step = jnp.where(stands, jnp.where(short, 0.0, step), jnp.minimum(step, 1.0))
    turned = (jnp.arange(free.shape[0]) == hit) & ~ended
    this = ended & (legs_before(at.active.facets) == jnp.minimum(at.leg, 1))
    active = ActiveSet(
        jnp.where(turned, jnp.where(free, side, 0.0), at.active.side),
        jnp.where(this[:, None], jnp.where(short, across, 0.0)[None], at.active.facets),
    )
    whole = torque if first is None else torque + first
    more = jnp.all(active.facets == 0) & jnp.any(whole != 0)
    rest = jnp.where(stands, at.ahead, (1 - step) * at.ahead)
    following = jnp.where(at.leg == 0, torque + rest, BEYOND * whole)
    return Active(
        at.multiplier + step * way,
        active,
        jax.tree.map(lambda new, old: jnp.where(at.leg < 2, new, old), active, at.last),
        jnp.where(ended, following, rest),
        jnp.where(ended, at.leg + 1, at.leg),
        at.rounds + 1,
        ~ended | (at.leg == 0) | ((at.leg == 1) & more),
    )
