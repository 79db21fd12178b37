"""Allocation of a torque to all devices together.

Devices that cost propellant do only what free ones cannot, at the least price (`least_price`);
free ones share the rest by least squares (`least_squares_within`). Both are exact with bounds.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.smooth import within
from jaxsat.core.trees import choose
from jaxsat.spacecraft.bounded_least_squares import least_squares_within
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.least_propellant import GOLDEN, least_price

FREE_PRICE = 1e-6
"""Price of a free torque relative to the dearest one, so that no more of it is made than needed.
The least squares then share the free torque among the devices."""

UNBOUNDED = 1e6
"""Bound of a device without one, relative to the torque to be made."""


class Allocated(NamedTuple):
    """The `use` of each device, the part of the commanded torque that the uses make, and the part
    that they do not make (N m)."""

    use: Float[Array, " n"]
    torque: Vector
    unmade: Vector


class MomentumPrice(NamedTuple):
    """Price of momentum that the others make a device store, in the unit of a price of use.

    `shares` (n, 3) are the uses for a torque by devices that store momentum alone, zero for others.
    Uses beyond the share in the whole torque make up for others, and change the momentum. They cost
    `price`: a greater use if it is positive, a smaller one the size of a negative price. The other
    way costs nothing.
    """

    shares: Float[Array, "n 3"]
    price: Float[Array, " n"]


def allocate(
    reach: Reach,
    torque: Vector,
    before: Vector | None = None,
    momentum: MomentumPrice | None = None,
) -> Allocated:
    """Allocate `before` + `torque` (N m) to uses within the bounds of `reach`.

    The torque of devices that do not obey and the torque `before` have priority: the first is
    opposed and the second made as far as possible. Of the torque still lacking, the greatest part
    in its direction is made. Among all such uses the result has the least price, counted from the
    use nearest to zero, and among uses of equal price the least sum of squares of use over limit
    of the devices without a price. A price of None is zero. With `momentum`, which requires that
    all devices obey, the price of devices that store momentum counts from their shares instead.
    """
    before = jnp.zeros_like(torque) if before is None else before
    rest = jnp.zeros_like(reach.low)
    if momentum is not None:
        rest = jnp.where(momentum.price == 0, rest, momentum.shares @ (torque + before))
    idle = within(rest, reach.low, reach.high)
    units, size, turns = _units(reach.columns)
    low, high = (jnp.where(turns, size * (bound - idle), 0.0) for bound in (reach.low, reach.high))
    first = before - reach.columns @ idle
    if reach.price is None:
        each, unmade = least_squares_within(units, low, high, torque, first)
    else:
        price = reach.price / size
        prices = (price, price)
        if momentum is not None:
            more = momentum.price / size
            prices = (price + jnp.maximum(more, 0.0), price + jnp.maximum(-more, 0.0))
        each, unmade = _priced(prices, units, (low, high), torque, first)
    use = within(idle + each / size, reach.low, reach.high)
    return Allocated(use, before + torque - unmade, unmade)


def allocate_evenly(
    columns: Float[Array | np.ndarray, "3 n"], limit: Float[Array, " n"], torque: Vector
) -> Allocated:
    """Allocate a `torque` (N m) to devices with uses of at most `limit` both ways, as `allocate`.

    All devices obey and have no price.
    """
    units, size, turns = _units(columns)
    most = jnp.where(turns, size * limit, 0.0)
    each, unmade = least_squares_within(units, -most, most, torque)
    return Allocated(within(each / size, -limit, limit), torque - unmade, unmade)


def _units(
    columns: Float[Array | np.ndarray, "3 n"],
) -> tuple[Float[Array, "3 n"], Float[Array, " n"], Bool[Array, " n"]]:
    """Return unit columns and their sizes, 1 for a column that is zero, and which are not zero."""
    columns = jnp.asarray(columns)
    square = jnp.sum(columns**2, axis=0)
    size = jnp.sqrt(jnp.where(square > 0, square, 1.0))
    return columns / size[None], size, square > 0


def allocate_unloading(
    reach: Reach,
    torque: Vector,
    unloading: Vector,
    stores: Bool[Array, " n"],
    before: Vector | None = None,
    part: Callable[[Float[Array, " n"]], RealScalar] | None = None,
    momentum: MomentumPrice | None = None,
) -> Allocated:
    """Allocate a `torque` in which devices that store no momentum first make `unloading`.

    They make `unloading` in addition to a torque `before`. Devices that store momentum
    (`stores`) compensate `unloading` (N m), which reduces their momentum. `allocate` allocates all
    three. Only the fraction `part` of `unloading` is made, which may depend on the uses for all of
    it; None makes all.
    """
    before = jnp.zeros_like(torque) if before is None else before

    def without_storing(request: Vector) -> tuple[Reach, Vector, Vector]:
        low, high = (jnp.where(stores, 0.0, bound) for bound in (reach.low, reach.high))
        return reach._replace(low=low, high=high), request, before

    def gently(use: Float[Array, " n"]) -> Vector:
        return unloading if part is None else part(use) * unloading

    def beside(use: Float[Array, " n"]) -> tuple[Reach, Vector, Vector]:
        rest = reach._replace(low=reach.low - use, high=reach.high - use)
        return rest, torque - reach.columns @ use, jnp.zeros_like(torque)

    def allocated(use: Float[Array, " n"], turn: IntScalar):
        last = turn == 2
        first = without_storing(jnp.where(turn == 1, gently(use), unloading))
        problem = choose(last, beside(use), first)
        more = allocate(*problem, momentum=momentum)
        return jnp.where(last, use, 0.0) + more.use, more.unmade

    idle = jnp.all(unloading == 0) & jnp.all(before == 0)

    def one_more(so_far, turn):
        skips = (turn < 2) & idle | ((turn == 1) & jnp.all(gently(so_far[0]) == unloading))
        return jax.lax.cond(skips, lambda: so_far, lambda: allocated(so_far[0], turn)), None

    # A loop, so that the long code of an allocation is compiled once.
    none = (jnp.zeros_like(reach.high), jnp.zeros_like(torque))
    (use, unmade), _ = jax.lax.scan(one_more, none, jnp.arange(3))
    return Allocated(use, torque - unmade, unmade)


def share_within(
    axes: Float[Array, "3 m"],
    limit: Float[Array, " m"],
    shares: Float[Array, " m"],
    beyond: Bool[Array, " m"] | None = None,
) -> tuple[Float[Array, " m"], Vector]:
    """Return `shares` (N m) along unit `axes`, reallocated where one exceeds its `limit`.

    Until a share is `beyond` its own limit (computed if None), the result equals `shares` to the
    bit. Returns the torques, and the part of their sum that is not made (N m).
    """
    beyond = jnp.any(jnp.abs(shares) > limit if beyond is None else beyond)
    torque = axes @ jnp.where(beyond, shares, 0.0)
    use, _, unmade = allocate_evenly(axes, limit, torque)
    return jnp.where(beyond, use, shares), unmade


def first_at_limit(shares: Float[Array, " m"], limit: Float[Array, " m"]) -> Float[Array, " m"]:
    """Return event functions of `share_within`: positive for the first device beyond its limit."""
    ratios = (shares / limit) ** 2
    others = jnp.where(jnp.eye(ratios.shape[0], dtype=bool), 0.0, ratios)
    return ratios - jnp.maximum(jnp.max(others, axis=1), 1.0)


def _priced(
    prices: tuple[Float[Array, " n"], Float[Array, " n"]],
    units: Float[Array, "3 n"],
    bounds: tuple[Float[Array, " n"], Float[Array, " n"]],
    torque: Vector,
    first: Vector,
) -> tuple[Float[Array, " n"], Vector]:
    """Return torques of least price and, of free devices, least squares; and the unmade torque.

    The `prices` are of torques forth and back; a device is free if both are zero.
    """
    low, high = bounds
    price = jnp.concatenate(prices)
    free, dearest = (prices[0] <= 0) & (prices[1] <= 0), jnp.max(price)
    spread = jnp.tile(1 + GOLDEN * jnp.arange(low.shape[0], dtype=low.dtype) % 1, 2)
    scale = jnp.where(dearest > 0, dearest, 1.0)
    upper = jnp.concatenate([high, -low])
    finite = jnp.where(jnp.isfinite(upper), upper, 0.0)
    most = jnp.max(finite) + jnp.sum(jnp.abs(torque) + jnp.abs(first))
    upper = jnp.where(jnp.isfinite(upper), finite, jax.lax.stop_gradient(UNBOUNDED * most))
    thrust, unmade = least_price(
        jnp.concatenate([units, -units], axis=1),
        upper,
        jnp.where(price <= 0, FREE_PRICE * spread, price / scale),
        torque,
        first,
        jnp.array(True),
    )
    forth, back = jnp.split(thrust, 2)
    paid = within(jnp.where(free, 0.0, forth - back), low, high)
    rest = torque + first - unmade - units @ paid
    shared, _ = least_squares_within(
        units, jnp.where(free, low, 0.0), jnp.where(free, high, 0.0), rest
    )
    return paid + shared, unmade
