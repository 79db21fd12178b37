"""Duties of the thrusters left that make a torque with least propellant: a small simplex method.

The revised simplex method for a linear programme of three equations (Dantzig, Linear Programming
and Extensions, 1963, chapter 9), in plain `jax.numpy` and with bounded pivots.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.allocation import best_basis, unit_columns
from jaxsat.checks import as_array, as_float

RealScalar = Float[Array, ""]

VIOLATION = 1e3
"""What a torque that is missed costs, over the dearest thruster's that makes as much."""

PIVOTS_A_THRUSTER = 4
"""The method ends after so many pivots for each thruster; it needs one or less."""

LEAST_PIVOT = 1e-9
"""Of unit columns: what is below counts as zero."""

GAIN = 1e-10
"""Of the cost of a missed torque: a thruster that saves less does not enter the basis."""

PERTURBATION = np.array([0.9, 1.1, 1.3]) * 1e-9
"""Of the torque, about each axis: what is added while pivots are chosen.

Without it a pivot may leave the duties as they are, and such pivots may go round in a circle.
"""


class Basis(NamedTuple):
    """Three thrusters and the way each counts: 1 as it pushes, -1 as what it would have to pull.

    `price` is what each costs, `inverse` that of their columns with those signs. `improves` tells
    whether the last pivot gained anything.
    """

    members: Int[Array, "3"]
    ways: Float[Array, "3"]
    price: Float[Array, "3"]
    inverse: Float[Array, "3 3"]
    pivots: Int[Array, ""]
    improves: Bool[Array, ""]


class CheapestDuties(eqx.Module):
    """Duties, however large, that make a torque at least cost by thrusters that have not failed.

    `units` (3, m) are the torques at full thrust over their `size` (N m), `price` the cost of a
    torque by each. Of a torque that cannot be made the least is missed: what failed thrusters would
    make, and others if they could pull, counts as missed, at the price `VIOLATION`. So any three
    independent thrusters are a basis to begin with. `first` is the best conditioned one and
    `inverse` that of its columns.
    """

    units: Float[Array, "3 m"] = eqx.field(converter=as_float)
    size: Float[Array, " m"] = eqx.field(converter=as_float)
    price: Float[Array, " m"] = eqx.field(converter=as_float)
    first: Int[Array, "3"]
    inverse: Float[Array, "3 3"] = eqx.field(converter=as_float)

    @staticmethod
    def of(torque: Float[np.ndarray, "3 m"], cost: Float[np.ndarray, " m"]) -> "CheapestDuties":
        """For thrusters whose torques (N m) at full thrust span all axes, and what that costs."""
        units, size = unit_columns(torque), np.sqrt(np.sum(torque**2, axis=0))
        price = cost / size
        first = best_basis(units)
        inverse = np.linalg.inv(units[:, first])
        return CheapestDuties(units, size, price / price.max(), as_array(first), inverse)

    def __call__(self, failed: Bool[Array, " m"], torque: Float[Array, "3"]) -> Float[Array, " m"]:
        """The duties for a torque (N m)."""
        return _cheapest(self, failed, torque)


@jax.jit
def _cheapest(
    table: CheapestDuties, failed: Bool[Array, " m"], torque: Float[Array, "3"]
) -> Float[Array, " m"]:
    """Compiled once, however often it is called."""
    price = table.price + jnp.where(failed, VIOLATION, 0.0)
    nearby = torque + jnp.asarray(PERTURBATION, torque.dtype) * jnp.sum(jnp.abs(torque))
    most = PIVOTS_A_THRUSTER * table.size.shape[0]

    last = jax.lax.while_loop(
        lambda basis: basis.improves & (basis.pivots < most),
        lambda basis: _pivot(table.units, price, nearby, basis),
        _first(table, price, nearby),
    )
    thrust = jnp.maximum(jnp.sum(last.inverse * torque[None], axis=1), 0.0)
    used = jnp.arange(failed.shape[0])[:, None] == last.members[None]
    duty = jnp.sum(jnp.where(used, jnp.where(last.ways > 0, thrust, 0.0)[None], 0.0), axis=1)
    return jnp.where(failed, 0.0, duty / table.size)


def _first(table: CheapestDuties, price: Float[Array, " m"], torque: Float[Array, "3"]) -> Basis:
    """The basis to begin with: each counts in the way that makes the torque."""
    ways = jnp.where(jnp.sum(table.inverse * torque[None], axis=1) < 0, -1.0, 1.0)
    return Basis(
        table.first,
        ways,
        jnp.where(ways > 0, price[table.first], VIOLATION),
        ways[:, None] * table.inverse,
        jnp.array(0),
        jnp.array(True),
    )


def _pivot(
    units: Float[Array, "3 m"], price: Float[Array, " m"], torque: Float[Array, "3"], basis: Basis
) -> Basis:
    """The thruster that saves most for its torque takes the place of the one that runs out."""
    dual = jnp.sum(basis.price[:, None] * basis.inverse, axis=0)
    worth = jnp.sum(units * dual[:, None], axis=0)
    saved = jnp.maximum(worth - price, -worth - VIOLATION)
    enters = jnp.argmax(saved)
    way = jnp.where(worth[enters] > 0, 1.0, -1.0)
    made = jnp.sum(basis.inverse * (way * units[:, enters])[None], axis=1)
    thrust = jnp.sum(basis.inverse * torque[None], axis=1)
    shrinks = made > LEAST_PIVOT
    until = jnp.where(shrinks, thrust / jnp.where(shrinks, made, 1.0), jnp.inf)
    leaves = jnp.argmin(until)
    improves = (saved[enters] > GAIN * VIOLATION) & jnp.any(shrinks)
    hit = (jnp.arange(3) == leaves) & improves
    row = basis.inverse[leaves] / jnp.where(improves, made[leaves], 1.0)
    others = basis.inverse - made[:, None] * row[None]
    inverse = jnp.where(hit[:, None], row[None], others)
    return Basis(
        jnp.where(hit, enters, basis.members),
        jnp.where(hit, way, basis.ways),
        jnp.where(hit, jnp.where(way > 0, price[enters], VIOLATION), basis.price),
        jnp.where(improves, inverse, basis.inverse),
        basis.pivots + 1,
        improves,
    )
