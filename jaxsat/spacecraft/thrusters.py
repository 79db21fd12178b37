"""Thrusters, their torque map (3)-(9), and the failures that take columns out of it."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.allocation import NORMALISER_FLOOR, allocation_matrix, unit_columns
from jaxsat.core.checks import as_array, as_float, concrete, require_finite


class Thrusters(eqx.Module):
    """Thrusters by the direction of the torque that each makes, equation (3).

    `torque_axes` has shape (3, m): column j holds the direction cosines of thruster j's torque in
    body axes. Each thruster makes a torque of either sign. Raises `ValueError` for a column that
    is not finite or is zero; columns are scaled to unit length.
    """

    torque_axes: Float[Array, "3 m"]

    def __init__(self, torque_axes: ArrayLike | list):
        axes = as_float(torque_axes)
        if axes.ndim != 2 or axes.shape[0] != 3:
            raise ValueError(
                f"Argument `torque_axes` must have shape (3, m), but got {tuple(axes.shape)}."
            )
        require_finite("torque_axes", axes)
        known = concrete(axes)
        if known is None:
            self.torque_axes = axes / jnp.sqrt(jnp.sum(axes**2, axis=0, keepdims=True))
            return
        self.torque_axes = as_array(unit_columns(known))

    @property
    def count(self) -> int:
        """How many thrusters there are."""
        return self.torque_axes.shape[1]

    def torque(self, thrust: Float[Array, "m"]) -> Float[Array, "3"]:
        """Equations (3), (4), (7): the body torque, N m, of thrusts given as torques, N m."""
        return self.torque_axes @ thrust

    def without(self, failed: Sequence[int]) -> "Thrusters":
        """The thrusters that remain when those numbered `failed` (from 1) have failed."""
        unknown = sorted(set(failed) - set(range(1, self.count + 1)))
        if unknown:
            raise ValueError(
                f"Argument `failed` must name thrusters from 1 to {self.count}, but got {unknown}."
            )
        kept = [j for j in range(self.count) if j + 1 not in failed]
        known = concrete(self.torque_axes)
        axes = self.torque_axes if known is None else known
        return Thrusters(axes[:, np.array(kept, dtype=int)])


def two_thruster_coupling(thrusters: Thrusters) -> Float[Array, "2"]:
    """b1 and b2 of equation (5): the third torque is b1 u1 + b2 u2.

    Raises `ValueError` unless there are two thrusters whose torques about the first two body axes
    are independent; where they are not, (5) divides by zero although the layout may be sound.
    """
    if thrusters.count != 2:
        raise ValueError(f"b1, b2 of (5) must have two thrusters, but got {thrusters.count}.")
    upper, third = thrusters.torque_axes[:2], thrusters.torque_axes[2]
    determinant = upper[0, 0] * upper[1, 1] - upper[1, 0] * upper[0, 1]
    _require_normaliser(
        determinant, "b1, b2 of (5) must have cosα1 cosβ2 - cosα2 cosβ1 away from zero"
    )
    b1 = third[0] * upper[1, 1] - upper[1, 0] * third[1]
    b2 = upper[0, 0] * third[1] - third[0] * upper[0, 1]
    return jnp.stack([b1, b2]) / determinant


def one_thruster_coupling(thrusters: Thrusters) -> Float[Array, "2"]:
    """c1 and c2 of equation (8): the torque is u1 (1, c1, c2)ᵀ.

    Raises `ValueError` unless there is one thruster with some torque about the first body axis.
    """
    if thrusters.count != 1:
        raise ValueError(f"c1, c2 of (8) must have one thruster, but got {thrusters.count}.")
    axis = thrusters.torque_axes[:, 0]
    _require_normaliser(axis[0], "c1, c2 of (8) must have cosα1 away from zero")
    return axis[1:] / axis[0]


def allocation(thrusters: Thrusters, torques: int = 2) -> Float[Array, "m torques"]:
    """`jaxsat.core.allocation.allocation_matrix` of these thrusters."""
    return as_array(allocation_matrix(np.asarray(thrusters.torque_axes), torques))


def _require_normaliser(value: Float[Array, ""], rule: str) -> None:
    known = concrete(value)
    if known is not None and abs(known) < NORMALISER_FLOOR:
        raise ValueError(f"{rule}, but got {float(known):.3g}.")
