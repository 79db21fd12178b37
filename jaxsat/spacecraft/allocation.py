"""One allocation for all devices: what each is to do so that together they make a torque.

Devices that cost propellant do only what free ones cannot, at the least price (`least_price`);
free ones share what is left by least squares (`least_squares_within`). Both are exact with bounds.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.smooth import within
from jaxsat.core.trees import choose
from jaxsat.spacecraft.bounded_least_squares import least_squares_within
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.least_propellant import GOLDEN, least_price

FREE_PRICE = 1e-6
"""Of the dearest torque: the price of a torque that is free, so that no more of it is made than
is needed. The sum of squares decides afterwards how much of it each device makes."""

UNBOUNDED = 1e6
"""Of the torque to be made: the bound of a device without one."""


class Allocated(NamedTuple):
    """The `use` of each device, the torque that they make of the one asked for, and what is left
    (N m)."""

    use: Float[Array, " n"]
    made: Vector
    unmade: Vector


def allocate(reach: Reach, torque: Vector, before: Vector | None = None) -> Allocated:
    """Uses within the bounds of `reach` whose torques add up to `before` + `torque` (N m).

    What devices make that do not obey comes first, and the torque `before`, if given: both are
    opposed and made as far as possible. Of what is then lacking, the greatest part in its direction
    is made. Of all such uses these have the least price, which counts from the use nearest to zero,
    and of those with the same use of devices that have a price, the least sum of squares of use
    over limit of the others. A price of None is none.
    """
    idle = within(jnp.zeros_like(reach.low), reach.low, reach.high)
    square = jnp.sum(reach.columns**2, axis=0)
    size = jnp.sqrt(jnp.where(square > 0, square, 1.0))
    units = reach.columns / size[None]
    low, high = (
        jnp.where(square > 0, size * (bound - idle), 0.0) for bound in (reach.low, reach.high)
    )
    before = jnp.zeros_like(torque) if before is None else before
    first = before - reach.columns @ idle
    if reach.price is None:
        each, unmade = least_squares_within(units, low, high, torque, first)
    else:
        each, unmade = _priced(reach.price / size, units, (low, high), torque, first)
    use = within(idle + each / size, reach.low, reach.high)
    return Allocated(use, before + torque - unmade, unmade)


def allocate_unloading(
    reach: Reach,
    torque: Vector,
    unloading: Vector,
    stores: Bool[Array, " n"],
    before: Vector | None = None,
    part: Callable[[Float[Array, " n"]], RealScalar] | None = None,
) -> Allocated:
    """Uses that make a `torque`, of which devices that store no momentum make `unloading` first,
    beside a part of the torque that they make `before` that.

    Those that store momentum, as `stores` says, make up for `unloading` (N m), which takes it out
    of them. All three are allocated as by `allocate`. Of `unloading` only a `part` is made, which
    may depend on the uses for all of it; without it all.
    """
    before = jnp.zeros_like(torque) if before is None else before

    def without_storing(wanted: Vector) -> tuple[Reach, Vector, Vector]:
        low, high = (jnp.where(stores, 0.0, bound) for bound in (reach.low, reach.high))
        return reach._replace(low=low, high=high), wanted, before

    def gently(use: Float[Array, " n"]) -> Vector:
        return unloading if part is None else part(use) * unloading

    def beside(use: Float[Array, " n"]) -> tuple[Reach, Vector, Vector]:
        rest = reach._replace(low=reach.low - use, high=reach.high - use)
        return rest, torque - reach.columns @ use, jnp.zeros_like(torque)

    def allocated(use: Float[Array, " n"], turn: IntScalar):
        last = turn == 2
        first = without_storing(jnp.where(turn == 1, gently(use), unloading))
        asked = choose(last, beside(use), first)
        more = allocate(*asked)
        return jnp.where(last, use, 0.0) + more.use, more.unmade

    idle = jnp.all(unloading == 0) & jnp.all(before == 0)

    def one_more(so_far, turn):
        skips = (turn < 2) & idle | ((turn == 1) & jnp.all(gently(so_far[0]) == unloading))
        return jax.lax.cond(skips, lambda: so_far, lambda: allocated(so_far[0], turn)), None

    # A loop, because the code of an allocation is long: it is compiled once.
    none = (jnp.zeros_like(reach.high), jnp.zeros_like(torque))
    (use, unmade), _ = jax.lax.scan(one_more, none, jnp.arange(3))
    return Allocated(use, torque - unmade, unmade)


def share_within(
    axes: Float[Array, "3 m"],
    limit: Float[Array, " m"],
    shares: Float[Array, " m"],
    beyond: Bool[Array, " m"] | None = None,
) -> tuple[Float[Array, " m"], Vector]:
    """The torques `shares` (N m) along unit `axes`, allocated within a `limit` where they are not.

    So they are to the bit what they are without limits until one is `beyond` its own, which is
    found out where it is not told. Given are the torques, and what of their sum is not made (N m).
    """
    beyond = jnp.any(jnp.abs(shares) > limit if beyond is None else beyond)
    torque = axes @ jnp.where(beyond, shares, 0.0)
    use, _, unmade = allocate(Reach(axes, -limit, limit), torque)
    return jnp.where(beyond, use, shares), unmade


def first_at_limit(shares: Float[Array, " m"], limit: Float[Array, " m"]) -> Float[Array, " m"]:
    """Positive for the device that is first beyond its limit: event functions of `share_within`."""
    ratios = (shares / limit) ** 2
    others = jnp.where(jnp.eye(ratios.shape[0], dtype=bool), 0.0, ratios)
    return ratios - jnp.maximum(jnp.max(others, axis=1), 1.0)


def _priced(
    price: Float[Array, " n"],
    units: Float[Array, "3 n"],
    bounds: tuple[Float[Array, " n"], Float[Array, " n"]],
    torque: Vector,
    first: Vector,
) -> tuple[Float[Array, " n"], Vector]:
    """Torques of each, and what is not made: at a `price`, then of those that have none."""
    low, high = bounds
    free, dearest = price <= 0, jnp.max(price)
    spread = 1 + GOLDEN * jnp.arange(price.shape[0], dtype=price.dtype) % 1
    each_price = jnp.where(free, FREE_PRICE * spread, price / jnp.where(dearest > 0, dearest, 1.0))
    upper = jnp.concatenate([high, -low])
    finite = jnp.where(jnp.isfinite(upper), upper, 0.0)
    most = jnp.max(finite) + jnp.sum(jnp.abs(torque) + jnp.abs(first))
    upper = jnp.where(jnp.isfinite(upper), finite, jax.lax.stop_gradient(UNBOUNDED * most))
    thrust, unmade = least_price(
        jnp.concatenate([units, -units], axis=1),
        upper,
        jnp.concatenate([each_price, each_price]),
        torque,
        first,
        jnp.array(True),
    )
    forth, back = jnp.split(thrust, 2)
    paid = within(jnp.where(free, 0.0, forth - back), low, high)
    rest = torque + first - unmade - units @ paid
    shared, _ = least_squares_within(
        units, jnp.where(free, low, 0.0), jnp.where(free, high, 0.0), rest, 0 * rest
    )
    return paid + shared, unmade
