"""Legs of a torque that grows from zero: a first torque, then the torque itself.

Methods that follow the optimum all the way end a leg where no more torque can be made in its
direction, at a facet of the set of all torques.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxsat.core.array_types import IntScalar, Vector

ZERO = 0.6
"""Power of the machine precision that is the tolerance on unit columns and torques.

Prices differ by at least this much: equal prices may make pivots cycle without progress.
"""


def zero_below(x: Array) -> float:
    """Return the tolerance of a method with numbers like these."""
    return float(jnp.finfo(x.dtype).eps) ** ZERO


def parts_up_to(
    facets: Float[Array, "legs 3"],
    units: Float[Array, "3 m"],
    bounds: tuple[Float[Array, " m"] | None, Float[Array, " m"]],
    torque: Vector,
    first: Vector | None,
) -> Vector:
    """Return the part of a torque `first` up to a facet, and from there on that of the rest of
    `first` + `torque` up to another one (N m); with None, the part of `torque`."""
    if first is None:
        return _part_up_to(facets[0], units, bounds, None, torque)
    total = _part_up_to(facets[0], units, bounds, None, first)
    return total + _part_up_to(facets[1], units, bounds, total, torque + first - total)


def _part_up_to(
    facet: Vector,
    units: Float[Array, "3 m"],
    bounds: tuple[Float[Array, " m"] | None, Float[Array, " m"]],
    start: Vector | None,
    torque: Vector,
) -> Vector:
    """Return the part of a `torque` up to a `facet` of the torque set, from `start` on (N m).

    The torques along `units` are between two `bounds` (N m). None is zero. A zero facet does not
    bound.
    """
    low, high = bounds
    along = jnp.sum(facet[:, None] * units, axis=0)
    farthest = jnp.sum(jnp.where(along > zero_below(high), along, 0.0) * high)
    if low is not None:
        farthest = farthest + jnp.sum(jnp.where(along < -zero_below(high), along, 0.0) * low)
    speed = jnp.sum(facet * torque)
    ends = speed > 0
    ahead = farthest if start is None else farthest - jnp.sum(facet * start)
    part = ahead / jnp.where(ends, speed, 1.0)
    return jnp.where(ends & (part < 1), part, 1.0) * torque


def begun_legs(
    torque: Vector, first: Vector | None
) -> tuple[Float[Array, "legs 3"], Vector, IntScalar]:
    """Return the facets of the legs, none yet, the torque ahead and the number of its leg: 0 for a
    torque `first`, 1 for the `torque` itself."""
    if first is None:
        return jnp.zeros((1, 3), torque.dtype), torque, jnp.array(1)
    comes_first = jnp.any(first != 0)
    facets = jnp.zeros((2, 3), torque.dtype)
    return facets, jnp.where(comes_first, first, torque), jnp.where(comes_first, 0, 1)


def legs_before(facets: Float[Array, "legs 3"]) -> Int[Array, " legs"]:
    """Return the numbers of the legs before the last, in order; the first is 1 if no torque comes
    first."""
    return jnp.arange(2 - facets.shape[0], 2)
