"""Directions of actuators in body axes."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import Vector
from jaxsat.core.checks import as_array, as_float, concrete, numpy_if_known, require_finite
from jaxsat.core.errors import ArgumentError


def unit_axes(axes: Array, name: str = "axes") -> Float[Array, "3 n"]:
    """Return columns of shape (3, n) scaled to unit length; raises `ValueError` for a zero one."""
    if axes.ndim != 2 or axes.shape[0] != 3:
        raise ArgumentError(name, "must have shape (3, n)", tuple(axes.shape))
    require_finite(name, axes)
    concrete_axes = concrete(axes)
    if concrete_axes is None:
        return axes / jnp.sqrt(jnp.sum(axes**2, axis=0, keepdims=True))
    if not np.all(np.any(concrete_axes != 0, axis=0)):
        raise ArgumentError(name, "must have no zero column", concrete_axes.tolist())
    return as_array(unit_columns(concrete_axes))


def of_each(value: ArrayLike | list | tuple, count: int) -> Float[Array, " n"]:
    """Return an array of `count` numbers from one number per device, or one for all."""
    xp, numbers = numpy_if_known(as_float(value))
    return as_float(xp.broadcast_to(numbers, (count,)))


def turned_axes(axes: Float[Array, "3 m"], angles: Float[Array, "m 2"]) -> Float[Array, "3 m"]:
    """Return unit columns turned by small angles (rad) towards two perpendicular directions each.

    The tangents use the small-angle approximation.
    """
    across = jnp.stack([directions_across(axis) for axis in axes.T])  # (m, 2, 3)
    turned = axes.T + jnp.sum(angles[:, :, None] * across, axis=1)
    return (turned / jnp.sqrt(1 + jnp.sum(angles**2, axis=1, keepdims=True))).T


def directions_across(axis: Vector) -> Float[Array, "2 3"]:
    """Return two directions perpendicular to a unit vector and to each other."""
    least = jnp.eye(3, dtype=axis.dtype)[jnp.argmin(jnp.abs(axis))]
    first = jnp.cross(axis, least)
    first = first / jnp.sqrt(jnp.sum(first**2))
    return jnp.stack([first, jnp.cross(axis, first)])
