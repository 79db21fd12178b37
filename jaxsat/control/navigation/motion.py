"""Motion as the filter by the dynamics estimates it: attitude, rate, torque and gyro bias."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.navigation.kalman_filter import Gains
from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion


class MotionBelief(NamedTuple):
    """Attitude, rate (rad/s), unknown torque (N m), gyro bias (rad/s) and the error of the momentum
    measured at this sample (N m s, body axes), with the covariance of their errors.

    With the true attitude q ⊗ (1, δ/2), the true rate ω + ε, torque d + ξ, bias b + β and error of
    the momentum `excess` + v, `covariance` is that of δ, ε, ξ, β and v; without a gyro there is no
    bias, with exact tachometers no excess.
    """

    q: Float[Array, "4"]
    omega: Vector
    torque: Vector
    covariance: Float[Array, "n n"]
    bias: Vector | None = None
    excess: Vector | None = None

    def narrowed(
        self, axis: Vector, variance: RealScalar, valid: BoolScalar, *errors: int
    ) -> tuple["MotionBelief", Gains]:
        """The covariance after a measurement of the sum of `errors`, by default of δ, along an axis
        with this variance."""
        parts = [slice(3 * one, 3 * one + 3) for one in errors or (0,)]
        first, *others = (self.covariance[:, part] @ axis for part in parts)
        column = sum(others, first)
        first, *others = (axis @ column[part] for part in parts)
        scale = jnp.where(valid, 1 / (sum(others, first) + variance), 0.0)
        gains = tuple(column[begin : begin + 3] for begin in range(0, column.shape[0], 3))
        covariance = self.covariance - scale * column[:, None] * column[None, :]
        return self._replace(covariance=covariance), Gains(gains, scale)

    def shifted(
        self, attitude: Vector, omega: Vector, torque: Vector, *more: Vector
    ) -> "MotionBelief":
        """The motion turned by a small rotation (rad), with changes of the rest in its order."""
        q, changes = Quaternion(self.q).turned(attitude).q, iter(more)
        bias = None if self.bias is None else self.bias + next(changes)
        excess = None if self.excess is None else self.excess + next(changes)
        return MotionBelief(
            q, self.omega + omega, self.torque + torque, self.covariance, bias, excess
        )
