"""Bounded least-cost allocation: torques that make a torque at the least price, by the simplex.

The parametric dual simplex method with bounds (Dantzig, Linear Programming and Extensions, 1963,
chapters 11 and 18) for a linear programme of three equations, in plain `jax.numpy`. The torque
grows from zero, and the solution is optimal all the way. Where no pivot is left, the result is the
greatest part of the torque in its direction: there is no first phase, and no penalty.
"""

import math
from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxsat.core.allocation import least_propellant, unit_columns
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, Vector
from jaxsat.core.checks import as_float, as_optional_float
from jaxsat.core.smooth import positive_part, within
from jaxsat.spacecraft.spacecraft import adjugate
from jaxsat.spacecraft.torque_legs import begun_legs, legs_before, parts_up_to, zero_below

PIVOTS_A_THRUSTER = 4
"""Largest number of pivots for each thruster; the method needs one or two."""

GOLDEN = (math.sqrt(5) - 1) / 2
"""Golden ratio: fractional parts of its multiples are evenly spread in (0, 1) and distinct."""

ANY_WAY = (0.62, -0.31, 0.72)
"""A generic direction, in which no layout is likely to lose rank."""


class Vertex(NamedTuple):
    """Basis of three thrusters with duties between their bounds, the others at one of theirs.

    `members` are the numbers of the basis; from m on they are artificial unit torques, with which
    the method begins. `columns` has a row for each member, its torque over its size; `price`,
    `upper` and `thrust` (N m) are also the members'. `side` is 1 for a thruster at zero, -1 for one
    at its upper bound, and 0 for a member or a thruster without any duty. `ahead` (N m) is the
    torque still to be made by this `leg`, see `_next_leg`. `facets` has a row for each leg before
    the last: the normal of the facet of the torque set that ended it, zero if none did.
    """

    members: Int[Array, "3"]
    columns: Matrix
    price: Vector
    upper: Vector
    thrust: Vector
    side: Float[Array, " m"]
    ahead: Vector
    facets: Float[Array, "legs 3"]
    leg: IntScalar
    pivots: IntScalar
    goes: BoolScalar


class Programme(NamedTuple):
    """Unit columns of the thrusters' torques, their largest sizes (N m) and their prices."""

    units: Float[Array, "3 m"]
    upper: Float[Array, " m"]
    price: Float[Array, " m"]


class LeastPropellant(eqx.Module):
    """Duties d, 0 <= d <= limit, that make a torque with least propellant.

    `units` (3, m) are the torques at full thrust over their `size` (N m), `price` the cost of a
    torque by each, and `command_map` (3, torques) maps a command to a torque on the body. Any
    layout is allowed, also one with coplanar torques. Of a torque out of reach the greatest part is
    made in its direction. At most `between` duties are neither zero nor at their limit. `table`
    (bases, m, torques) has the duties of `jaxsat.core.allocation.least_propellant`: while none
    exceeds 1, the basis without a negative duty is the solution, and no loop runs.
    """

    units: Float[Array, "3 m"] = eqx.field(converter=as_float)
    size: Float[Array, " m"] = eqx.field(converter=as_float)
    price: Float[Array, " m"] = eqx.field(converter=as_float)
    command_map: Float[Array, "3 torques"] = eqx.field(converter=as_float)
    table: Float[Array, "bases m torques"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    between: int = eqx.field(static=True, default=3)

    @staticmethod
    def of(
        torque: Float[np.ndarray, "3 m"],
        cost: Float[np.ndarray, " m"],
        command_map: Float[np.ndarray, "3 torques"] | None = None,
        tabled: bool = False,
    ) -> "LeastPropellant":
        """Return the allocation to thrusters with these torques (N m) and costs at full thrust.

        A command is a torque (N m) about the body axes unless `command_map` maps it to one. Raises
        `ValueError` for `tabled` thrusters that cannot make some command in both signs.
        """
        size = np.sqrt(np.sum(torque**2, axis=0))
        price = cost / size
        to_torque = np.eye(3) if command_map is None else command_map
        table = least_propellant(torque, cost, to_torque) if tabled else None
        return LeastPropellant(unit_columns(torque), size, price / price.max(), to_torque, table)

    def __call__(
        self,
        command: Float[Array, " torques"],
        limit: Float[Array, " m"] | None = None,
        first: Vector | None = None,
    ) -> tuple[Float[Array, " m"], Vector]:
        """Return the duties for a `command`, and the part of its torque not made (N m).

        Duties are mean fractions of full thrust over a period, up to a `limit` (1 if None). They
        also make a torque `first` (N m). Where the sum is out of reach, `first` is made as far as
        possible; then the greatest part of the rest in its direction.
        """
        torque = jnp.sum(self.command_map * command[None], axis=1)
        if self.table is None or limit is not None or first is not None:
            most = jnp.ones_like(self.size) if limit is None else limit
            return self._bounded(most, torque, first, jnp.array(True))
        candidates = jnp.sum(self.table * command[None, None, :], axis=-1)
        best = jnp.argmax(reduce(_smaller, candidates.T))
        duty = positive_part(candidates[best])
        within_bounds = jnp.max(duty) <= 1
        bounded, shortfall = self._bounded(jnp.ones_like(duty), torque, None, ~within_bounds)
        return (jnp.where(within_bounds, duty, bounded), jnp.where(within_bounds, 0.0, shortfall))

    def _bounded(self, limit, torque, first, runs):
        upper = limit * self.size
        thrust, shortfall = least_price(self.units, upper, self.price, torque, first, runs)
        return within(thrust / self.size, 0 * limit, limit), shortfall


def _smaller(x: Float[Array, " bases"], y: Float[Array, " bases"]) -> Float[Array, " bases"]:
    """Return the smaller of two numbers; the choice for NaN does not matter."""
    return jnp.where(x < y, x, y)


@jax.jit
def least_price(
    units: Float[Array, "3 m"],
    upper: Float[Array, " m"],
    price: Float[Array, " m"],
    torque: Vector,
    first: Vector | None,
    runs: BoolScalar,
) -> tuple[Float[Array, " m"], Vector]:
    """Compute torques u (N m) along `units`, 0 <= u <= `upper`, that make `first` + `torque` (N m).

    They have the least Σ `price` u, with prices of at most 1. Where the sum is out of reach,
    `first` (None is zero) is made as far as possible; then the greatest part of the rest in its
    direction. Returns u and the torque not made. Derivatives are those at the last vertex. Compiled
    once for any number of calls; the loop is skipped unless `runs`.
    """
    count = upper.shape[0]
    spread = GOLDEN * jnp.arange(count, dtype=upper.dtype) % 1
    price = price * (1 + zero_below(upper) * spread)
    constants = jax.lax.stop_gradient((Programme(units, upper, price), torque))
    last = jax.lax.while_loop(
        lambda at: at.goes & (at.pivots < PIVOTS_A_THRUSTER * (count + 2)),
        lambda at: _pivot(*constants, at),
        jax.lax.stop_gradient(_beginning(upper, torque, first)._replace(goes=runs)),
    )
    total = parts_up_to(last.facets, units, (None, upper), torque, first)
    full = jnp.where(last.side < 0, upper, 0.0)
    rest = total - jnp.sum(units * full[None], axis=1)
    thrust = jnp.sum(inverse_of_columns(last.columns) * rest[None], axis=1)
    used = jnp.arange(count)[:, None] == last.members[None]
    thrust = full + jnp.sum(jnp.where(used, thrust[None], 0.0), axis=1)
    return thrust, (torque if first is None else first + torque) - total


def _beginning(upper: Float[Array, " m"], torque: Vector, first: Vector | None) -> Vertex:
    """Return the initial vertex: no thrust, and all of the torque ahead."""
    none = jnp.zeros_like(torque)
    facets, ahead, leg = begun_legs(torque, first)
    return Vertex(
        upper.shape[0] + jnp.arange(3),
        jnp.eye(3, dtype=torque.dtype),
        none,
        none,
        none,
        jnp.where(upper > 0, 1.0, 0.0).astype(torque.dtype),
        ahead,
        facets,
        leg,
        jnp.array(0),
        jnp.array(True),
    )


def inverse_of_columns(columns: Matrix) -> Matrix:
    """Return the inverse, by rows, of the matrix whose columns are the rows of `columns`."""
    cofactors = adjugate(columns)
    return cofactors / jnp.sum(columns[0] * cofactors[0])


def _pivot(programme: Programme, torque: Vector, at: Vertex) -> Vertex:
    """Advance until a member meets a bound; then the cheapest other thruster replaces it."""
    units, upper, price = programme
    zero = zero_below(upper)
    inverse = inverse_of_columns(at.columns)
    rates = jnp.sum(inverse * at.ahead[None], axis=1)
    speed = jnp.abs(rates)
    moves = speed > zero * jnp.sum(jnp.abs(at.ahead))
    way = jnp.where(rates > 0, 1.0, -1.0)
    room = jnp.where(way > 0, at.upper - at.thrust, at.thrust)
    until = jnp.where(moves, room / jnp.where(moves, speed, 1.0), jnp.inf)
    nearest = jnp.maximum(jnp.min(until), 0.0)
    leaves = jnp.argmax(jnp.where(until <= nearest, speed, -1.0))
    normal = way[leaves] * inverse[leaves]
    dual = jnp.sum(at.price[:, None] * inverse, axis=0)
    dearer = at.side * (price - jnp.sum(units * dual[:, None], axis=0))
    helps = at.side * jnp.sum(units * normal[:, None], axis=0)
    usable = helps > zero
    each = jnp.where(usable, jnp.maximum(dearer, 0.0) / jnp.where(usable, helps, 1.0), jnp.inf)
    enters = jnp.argmin(each)
    turns = (nearest < 1) & jnp.any(usable)
    step = jnp.minimum(nearest, 1.0)
    hit = (jnp.arange(3) == leaves) & turns
    place = jnp.arange(upper.shape[0])
    side = jnp.where(place == at.members[leaves], -way[leaves], at.side)
    begins = jnp.where(at.side[enters] < 0, upper[enters], 0.0)
    vertex = at._replace(
        members=jnp.where(hit, enters, at.members),
        columns=jnp.where(hit[:, None], units[:, enters][None], at.columns),
        price=jnp.where(hit, price[enters], at.price),
        upper=jnp.where(hit, upper[enters], at.upper),
        thrust=jnp.where(hit, begins, at.thrust + step * rates),
        side=jnp.where(turns, jnp.where(place == enters, 0.0, side), at.side),
        ahead=(1 - step) * at.ahead,
        pivots=at.pivots + 1,
    )
    return _next_leg(upper, torque, vertex, turns, jnp.where(nearest < 1, normal, 0.0))


def _next_leg(
    upper: Float[Array, " m"], torque: Vector, at: Vertex, turns: BoolScalar, facet: Vector
) -> Vertex:
    """Return the next leg once this one ends: 0 is the first torque, 1 the torque (N m).

    Where members are artificial torques, the last leg exchanges them for thrusters as far as
    possible along a negligible torque, so that thrusters make a change of the torque.
    """
    ended = ~turns & (legs_before(at.facets) == at.leg)
    ways = jnp.asarray(ANY_WAY, upper.dtype) * (zero_below(upper) ** 2 * jnp.max(upper))
    ahead = jnp.where(at.leg == 0, torque + at.ahead, ways)
    more = (at.leg == 0) | ((at.leg == 1) & jnp.any(at.members >= upper.shape[0]))
    return at._replace(
        ahead=jnp.where(turns, at.ahead, ahead),
        facets=jnp.where(ended[:, None], facet[None], at.facets),
        leg=jnp.where(turns, at.leg, at.leg + 1),
        goes=turns | more,
    )
