"""Momentum about the axis that no wheel drives, and the attitudes that two wheels can hold with it.

Two wheels with the normal n leave n·Jω = n·(C H - β): H is the total momentum in the axes of the
target, C the attitude, β the momentum of unused wheels, fixed in the body. Rest requires n·C H =
n·β: the angle between n and the momentum must be arccos(n·β / |H|). The smallest rotation of the
body to such an attitude turns n in the plane of n and H.
"""

from typing import NamedTuple

import jax.numpy as jnp

from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.quotients import SMALLEST, length


class HeldAttitude(NamedTuple):
    """The attitude nearest to the target at which two wheels hold the body at rest.

    `attitude` is relative to the target, at an `angle` (rad) from it. `exists` is false if momentum
    about n remains at every attitude.
    """

    attitude: Quaternion
    angle: RealScalar
    exists: BoolScalar


def nearest_held(
    momentum: Vector, coasting: Vector, normal: Vector, error: RealScalar
) -> HeldAttitude:
    """The held attitude for the `momentum` H at the target attitude, without the part that the
    target's rate needs, the momentum of `coasting` wheels, and the unit vector n, all in body axes.

    H is known to within an `error`, all in the same unit: well below it, the attitude is the
    target.
    """
    unit = length(momentum) + SMALLEST
    momentum, coasting, error = momentum / unit, coasting / unit, error / unit
    across = jnp.cross(normal, momentum)
    size, along = jnp.sqrt(jnp.sum(across**2)), normal @ momentum
    whole = jnp.sqrt(size**2 + along**2)
    wanted = normal @ coasting
    beside = jnp.sqrt(jnp.maximum(whole**2 - wanted**2, 0.0))
    turn = jnp.arctan2(size, along) - jnp.arctan2(beside, wanted)
    least = jnp.eye(3)[jnp.argmin(jnp.abs(normal))]  # n along H: any axis across
    other = jnp.cross(normal, least)
    axis = jnp.where(size > 1e-9 * whole + SMALLEST, across, other)
    axis = axis / jnp.sqrt(jnp.sum(axis**2) + SMALLEST)
    turn = turn * whole**4 / (whole**4 + error**4 + SMALLEST)
    half = turn / 2
    attitude = Quaternion(jnp.concatenate([jnp.cos(half)[None], jnp.sin(half) * axis]))
    return HeldAttitude(attitude, jnp.abs(turn), jnp.abs(wanted) <= whole)


def relative_to(attitude: Quaternion, held: Quaternion) -> Quaternion:
    """An `attitude` relative to that of another frame, both relative to the target: q'⁻¹ q."""
    scalar, vector = held.q[0], -held.q[1:]
    own, part = attitude.q[0], attitude.q[1:]
    product = scalar * part + own * vector + jnp.cross(vector, part)
    return Quaternion(jnp.concatenate([(scalar * own - vector @ part)[None], product]))
