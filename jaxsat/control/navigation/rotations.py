"""Turns of the body as quaternions and as rotation vectors."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.attitude import Quaternion
from jaxsat.core.trigonometry import cos, sin


def rotation(angle: Float[Array, "3"]) -> Quaternion:
    """The turn of the body by a rotation vector, rad."""
    square = jnp.sum(angle**2) / 4
    turns = square > 0
    half = jnp.sqrt(jnp.where(turns, square, 1.0))
    share = jnp.where(turns, sin(half) / half, 1.0)
    return Quaternion(jnp.concatenate([jnp.where(turns, cos(half), 1.0)[None], share / 2 * angle]))


def product(q: Quaternion, turn: Quaternion) -> Quaternion:
    """q ⊗ p: the attitude q, then the turn p of the body."""
    return Quaternion(turn.q[0] * q.q + 2 * q.rate(turn.q[1:]).q)


def between(q: Quaternion, p: Quaternion) -> Quaternion:
    """The turn of the body from the attitude q to the attitude p, at most half a circle."""
    turn = product(Quaternion(q.q * jnp.array([1.0, -1.0, -1.0, -1.0])), p).q
    return Quaternion(jnp.where(turn[0] < 0, -turn, turn))


def difference(q: Quaternion, p: Quaternion) -> Float[Array, "3"]:
    """The small rotation (rad) with which `q.turned` gives p, the rotation vector to second order.

    2 tan(θ/2) in place of θ, so that a whole turn is found at once; held near half a circle.
    """
    turn = between(q, p).q
    return 2 * turn[1:] / jnp.maximum(turn[0], 0.01)


def rotation_vector(q: Quaternion, p: Quaternion) -> Float[Array, "3"]:
    """The same as a rotation vector, rad."""
    turn = between(q, p).q
    square = jnp.sum(turn[1:] ** 2)
    turns = square > 0
    size = jnp.sqrt(jnp.where(turns, square, 1.0))
    return turn[1:] * jnp.where(turns, 2 * jnp.arctan2(size, turn[0]) / size, 2.0)
