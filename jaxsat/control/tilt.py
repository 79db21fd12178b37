"""Tilt and turn: the attitude coordinates of the laws that steer the third axis.

With (w, z) of (36) the tilt (φ, θ) = 2 w / √(1 + |w|²) has |(φ, θ)| = 2 sin(tilt / 2): it stays
bounded upside down, and near zero φ, θ and z are the small angles about the three body axes.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.quotients import reciprocal
from jaxsat.core.roots import angle_of, root


class Tilt(NamedTuple):
    """Tilt (φ, θ), turn z in [-π, π] (rad), and |w|."""

    phi: Float[Array, ""]
    theta: Float[Array, ""]
    turn: Float[Array, ""]
    size: Float[Array, ""]


def tilt_of(attitude: AbstractAttitude) -> Tilt:
    """The tilt and turn of an attitude, finite also upside down (where the turn is arbitrary)."""
    q0, q1, q2, q3 = attitude.as_quaternion().q
    upright = root(q0**2 + q3**2)
    safe = jnp.maximum(upright, 1e-12)  # cos(tilt / 2)
    inverse = reciprocal(safe)
    sine1, sine2 = (q0 * q1 + q2 * q3) * inverse, (q0 * q2 - q1 * q3) * inverse
    sign = jnp.where(q0 < 0, -1.0, 1.0)
    turn = 2 * angle_of(sign * q3, sign * q0)
    return Tilt(2 * sine1, 2 * sine2, turn, root(q1**2 + q2**2) * inverse)
