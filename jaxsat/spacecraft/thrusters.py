"""Two-sided thrusters with their torque map (3)-(9), and one-sided thrusters."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.allocation import NORMALISER_FLOOR
from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, concrete, finite, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import CHANGE_OF_TORQUE, MISALIGNMENT
from jaxsat.spacecraft.axes import turned_axes, unit_axes
from jaxsat.spacecraft.dispersible import Dispersible, Limits

DISPERSIBLE: Mapping[str, Dispersible] = MappingProxyType(
    {
        "misalignment": Dispersible(
            lambda one, state, angles: (one.misaligned(angles.reshape(one.count, 2)), state),
            lambda one: Limits.between(MISALIGNMENT),
            each=2,
        ),
        "torque_gain": Dispersible(
            lambda one, state, change: (one.stronger(change), state),
            lambda one: Limits.between(CHANGE_OF_TORQUE),
        ),
    }
)
"""Effects of the dispersible quantities of all kinds of thrusters; the allocation remains that of
nominal thrusters."""


class Thrusters(eqx.Module):
    """Two-sided thrusters by the direction of the torque that each makes, equation (3).

    `torque_axes` has shape (3, m): column j holds the direction cosines of thruster j's torque in
    body axes. Each thruster makes a torque of either sign. Raises `ValueError` for a column that
    is not finite or is zero; columns are scaled to unit length.
    """

    torque_axes: Float[Array, "3 m"]

    def __init__(self, torque_axes: ArrayLike | list):
        self.torque_axes = unit_axes(as_float(torque_axes), "torque_axes")

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.torque_axes.shape[1]

    def torque(self, thrust: Float[Array, " m"]) -> Vector:
        """Return the body torque, N m, of thrusts as torques, N m: equations (3), (4), (7)."""
        return self.torque_axes @ thrust

    def without(self, failed: Sequence[int]) -> "Thrusters":
        """Return the thrusters that remain after those numbered `failed` (from 1) have failed."""
        unknown = sorted(set(failed) - set(range(1, self.count + 1)))
        if unknown:
            raise ArgumentError("failed", f"must name thrusters from 1 to {self.count}", unknown)
        working = [j for j in range(self.count) if j + 1 not in failed]
        concrete_axes = concrete(self.torque_axes)
        axes = self.torque_axes if concrete_axes is None else concrete_axes
        return Thrusters(axes[:, np.array(working, dtype=int)])


def two_thruster_coupling(thrusters: Thrusters) -> Pair:
    """Return b1 and b2 of equation (5): the third torque is b1 u1 + b2 u2.

    Raises `ValueError` unless there are two thrusters with independent torques about the first two
    body axes; otherwise (5) divides by zero although the layout may be controllable.
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


def one_thruster_coupling(thrusters: Thrusters) -> Pair:
    """Return c1 and c2 of equation (8): the torque is u1 (1, c1, c2)ᵀ.

    Raises `ValueError` unless there is one thruster with some torque about the first body axis.
    """
    if thrusters.count != 1:
        raise ValueError(f"c1, c2 of (8) must have one thruster, but got {thrusters.count}.")
    axis = thrusters.torque_axes[:, 0]
    _require_normaliser(axis[0], "c1, c2 of (8) must have cosα1 away from zero")
    return axis[1:] / axis[0]


def _require_normaliser(value: RealScalar, rule: str) -> None:
    number = concrete(value)
    if number is not None and abs(number) < NORMALISER_FLOOR:
        raise ValueError(f"{rule}, but got {float(number):.3g}.")


class ThrusterSet(eqx.Module):
    """m one-sided thrusters: the thrust of each is between zero and full.

    At full thrust thruster k makes the torque `torque`[:, k] (N m) and the force `force`[:, k] (N)
    on the body, both in body axes, and uses `flow`[k] (kg/s) of propellant. Its valve opens for
    `min_on_time`[k] (s) at least. `valve_delay` (s) is the time from a command to the valve;
    thrust rises and falls linearly, in `rise_time` and `fall_time` (s) between zero and full; None
    means zero for all thrusters. Raises `ValueError` for a torque that is zero or not finite, and
    for times or flows below zero.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=finite("torque"))
    force: Float[Array, "3 m"] = eqx.field(converter=finite("force"))
    flow: Float[Array, " m"] = eqx.field(converter=as_float)
    min_on_time: Float[Array, " m"] = eqx.field(converter=as_float)
    valve_delay: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)
    rise_time: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)
    fall_time: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)

    def __check_init__(self):
        torque = concrete(self.torque)
        if torque is not None and not np.all(np.any(torque != 0, axis=0)):
            raise ValueError("Argument `torque` must have no zero column, but one is zero.")
        if (self.rise_time is None) != (self.fall_time is None):
            raise ValueError("Arguments `rise_time` and `fall_time` must be given together.")
        for name in ("flow", "min_on_time", "valve_delay", "rise_time", "fall_time"):
            value = getattr(self, name)
            if value is not None:
                require_positive(name, value, zero_allowed=True)

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.torque.shape[1]

    @property
    def ramps(self) -> bool:
        """Whether thrust takes time to rise and fall."""
        return self.rise_time is not None

    def misaligned(self, angles: Float[Array, "m 2"]) -> "ThrusterSet":
        """Return thrusters with torques turned by small angles (rad) towards two directions across.

        Forces do not change. The tangents use the small-angle approximation.
        """
        size = jnp.sqrt(jnp.sum(self.torque**2, axis=0))
        turned = turned_axes(self.torque / size[None], angles)
        return eqx.tree_at(lambda one: one.torque, self, turned * size[None])

    def stronger(self, change: Float[Array, " m"]) -> "ThrusterSet":
        """Return thrusters with 1 + `change` times their torque and force at the same flow."""
        return eqx.tree_at(
            lambda one: (one.torque, one.force),
            self,
            (self.torque * (1 + change)[None], self.force * (1 + change)[None]),
        )
