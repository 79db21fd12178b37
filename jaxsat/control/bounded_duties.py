"""Duties within their bounds that make a torque with least propellant: a small simplex method.

The parametric dual simplex method with bounds (Dantzig, Linear Programming and Extensions, 1963,
chapters 11 and 18) for a linear programme of three equations, in plain `jax.numpy`. The torque
grows from zero, and the duties are optimal all the way. Where no pivot is left, that is as much
of the torque as can be made in its direction: there is no first phase, and no penalty.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.allocation import unit_columns
from jaxsat.checks import as_float

RealScalar = Float[Array, ""]

PIVOTS_A_THRUSTER = 4
"""The method ends after so many pivots for each thruster; it needs one or two."""

ZERO = 0.6
"""The power of the machine's precision that counts as zero, of unit columns and of a torque. By so
much prices differ at least: else a pivot may change nothing, and such pivots go round in a circle.
"""

GOLDEN = (math.sqrt(5) - 1) / 2
"""Parts of its multiples are spread evenly between 0 and 1, and none comes twice."""


class Vertex(NamedTuple):
    """Three thrusters with duties between their bounds, and the others at one of theirs.

    `members` are their numbers; from m on they are unit torques that are not to be had, with which
    the method begins. `columns` has a row for each, with its torque over its size, `price`, `upper`
    and `thrust` (N m) are theirs too. `side` is 1 for a thruster at zero, -1 for one at its upper
    bound, and 0 for one that is a member or has no duty at all. `ahead` (N m) is still to be made
    by way of this leg and `then` (N m) by the next one, if this is not the `last`.
    """

    members: Int[Array, "3"]
    columns: Float[Array, "3 3"]
    price: Float[Array, "3"]
    upper: Float[Array, "3"]
    thrust: Float[Array, "3"]
    side: Float[Array, " m"]
    ahead: Float[Array, "3"]
    then: Float[Array, "3"]
    last: Bool[Array, ""]
    pivots: Int[Array, ""]
    goes: Bool[Array, ""]


class BoundedDuties(eqx.Module):
    """Duties d, 0 <= d <= limit, that make a torque at least cost.

    `units` (3, m) are the torques at full thrust over their `size` (N m), `price` the cost of a
    torque by each. Any layout will do, also one whose torques are in a plane. Of a torque that
    cannot be made in full the greatest part is, in the same direction.
    """

    units: Float[Array, "3 m"] = eqx.field(converter=as_float)
    size: Float[Array, " m"] = eqx.field(converter=as_float)
    price: Float[Array, " m"] = eqx.field(converter=as_float)

    @staticmethod
    def of(torque: Float[np.ndarray, "3 m"], cost: Float[np.ndarray, " m"]) -> "BoundedDuties":
        """For thrusters with these torques (N m) at full thrust, and what that costs."""
        size = np.sqrt(np.sum(torque**2, axis=0))
        price = cost / size
        return BoundedDuties(unit_columns(torque), size, price / price.max())

    def __call__(
        self,
        limit: Float[Array, " m"],
        torque: Float[Array, "3"],
        first: Float[Array, "3"] | None = None,
    ) -> Float[Array, " m"]:
        """The duties, parts of full thrust up to a `limit`, for `torque` + `first` (N m).

        Where that is too much, `first` is made as far as it can be; then, of what the sum lacks,
        the greatest part in its direction.
        """
        return _duties(self, limit, torque, jnp.zeros_like(torque) if first is None else first)


@jax.jit
def _duties(
    table: BoundedDuties,
    limit: Float[Array, " m"],
    torque: Float[Array, "3"],
    first: Float[Array, "3"],
) -> Float[Array, " m"]:
    """Compiled once, however often it is called. Derivatives are those at the last vertex."""
    count = table.size.shape[0]
    upper = limit * table.size
    spread = GOLDEN * jnp.arange(count, dtype=upper.dtype) % 1
    price = table.price * (1 + _zero(upper) * spread)
    fixed = jax.lax.stop_gradient((table.units, upper, price))
    last = jax.lax.while_loop(
        lambda at: at.goes & (at.pivots < PIVOTS_A_THRUSTER * (count + 2)),
        lambda at: _pivot(*fixed, at),
        jax.lax.stop_gradient(_beginning(upper, torque, first)),
    )
    full = jnp.where(last.side < 0, upper, 0.0)
    rest = torque + first - last.ahead - last.then - jnp.sum(table.units * full[None], axis=1)
    thrust = jnp.sum(_inverse(last.columns) * rest[None], axis=1)
    thrust = jnp.clip(thrust, 0.0, last.upper)
    used = jnp.arange(count)[:, None] == last.members[None]
    duty = full + jnp.sum(jnp.where(used, thrust[None], 0.0), axis=1)
    return jnp.minimum(duty / table.size, limit)


def _zero(x: Array) -> float:
    """What counts as zero beside 1."""
    return float(jnp.finfo(x.dtype).eps) ** ZERO


def _beginning(
    upper: Float[Array, " m"], torque: Float[Array, "3"], first: Float[Array, "3"]
) -> Vertex:
    """No thrust, and all of the torque ahead."""
    last = ~jnp.any(first != 0)
    none = jnp.zeros_like(torque)
    return Vertex(
        upper.shape[0] + jnp.arange(3),
        jnp.eye(3, dtype=torque.dtype),
        none,
        none,
        none,
        jnp.where(upper > 0, 1.0, 0.0).astype(torque.dtype),
        jnp.where(last, torque, first),
        jnp.where(last, 0.0, torque),
        last,
        jnp.array(0),
        jnp.array(True),
    )


def _inverse(columns: Float[Array, "3 3"]) -> Float[Array, "3 3"]:
    """Of the matrix with these columns, one a row."""
    a, b, c = columns
    across = jnp.cross(b, c)
    adjugate = jnp.stack([across, jnp.cross(c, a), jnp.cross(a, b)])
    return adjugate / jnp.sum(a * across)


def _pivot(
    units: Float[Array, "3 m"], upper: Float[Array, " m"], price: Float[Array, " m"], at: Vertex
) -> Vertex:
    """As far as no member meets a bound; then the cheapest other takes the place of that one."""
    zero = _zero(upper)
    inverse = _inverse(at.columns)
    rates = jnp.sum(inverse * at.ahead[None], axis=1)
    speed = jnp.abs(rates)
    moves = speed > zero * jnp.sum(jnp.abs(at.ahead))
    way = jnp.where(rates > 0, 1.0, -1.0)
    room = jnp.where(way > 0, at.upper - at.thrust, at.thrust)
    until = jnp.where(moves, room / jnp.where(moves, speed, 1.0), jnp.inf)
    nearest = jnp.maximum(jnp.min(until), 0.0)
    leaves = jnp.argmax(jnp.where(until <= nearest, speed, -1.0))
    dual = jnp.sum(at.price[:, None] * inverse, axis=0)
    dearer = at.side * (price - jnp.sum(units * dual[:, None], axis=0))
    helps = at.side * way[leaves] * jnp.sum(units * inverse[leaves][:, None], axis=0)
    usable = helps > zero
    each = jnp.where(usable, jnp.maximum(dearer, 0.0) / jnp.where(usable, helps, 1.0), jnp.inf)
    enters = jnp.argmin(each)
    turns = (nearest < 1) & jnp.any(usable)
    step = jnp.minimum(nearest, 1.0)
    hit = (jnp.arange(3) == leaves) & turns
    place = jnp.arange(upper.shape[0])
    side = jnp.where(place == at.members[leaves], -way[leaves], at.side)
    begins = jnp.where(at.side[enters] < 0, upper[enters], 0.0)
    return Vertex(
        jnp.where(hit, enters, at.members),
        jnp.where(hit[:, None], units[:, enters][None], at.columns),
        jnp.where(hit, price[enters], at.price),
        jnp.where(hit, upper[enters], at.upper),
        jnp.where(hit, begins, at.thrust + step * rates),
        jnp.where(turns, jnp.where(place == enters, 0.0, side), at.side),
        (1 - step) * at.ahead + jnp.where(turns, 0.0, at.then),
        jnp.where(turns, at.then, 0.0),
        at.last | ~turns,
        at.pivots + 1,
        turns | ~at.last,
    )
