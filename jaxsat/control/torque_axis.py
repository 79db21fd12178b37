"""Any rigid body with one torque, in the frame in which it is easiest to steer."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.inertia import LEAST_TORQUE_TILT

RealScalar = Float[Array, ""]

SMALL = 1e-30
"""Keeps a quotient of zeros finite."""


class TorqueAxisFrame(NamedTuple):
    """Rows b, d, e of `axes`, and J⁻¹ along them: [[α, 0, γ], [0, δ, η], [γ, η, ζ]], 1/(kg m²)."""

    axes: Float[Array, "3 3"]
    alpha: RealScalar
    gamma: RealScalar
    delta: RealScalar
    eta: RealScalar
    zeta: RealScalar

    @staticmethod
    def of(inertia: Float[Array, "3 3"], axis: Float[Array, "3"]) -> "TorqueAxisFrame":
        """Of an inertia (kg m²) and the unit vector b; d ∝ J⁻¹b × b, e = b × d."""
        first, second, third = inertia
        adjugate = jnp.stack(
            [jnp.cross(second, third), jnp.cross(third, first), jnp.cross(first, second)]
        )
        inverse = adjugate / jnp.sum(first * adjugate[0])
        answer = inverse @ axis
        alpha = jnp.sum(axis * answer)
        side = jnp.cross(answer / alpha, axis)
        side = side / jnp.sqrt(jnp.sum(side**2) + SMALL)
        axes = jnp.stack([axis, side, jnp.cross(axis, side)])
        by_side, by_third = (inverse @ row for row in axes[1:])
        return TorqueAxisFrame(
            axes,
            alpha,
            jnp.maximum(jnp.sum(axes[2] * answer), LEAST_TORQUE_TILT * alpha),
            jnp.sum(side * by_side),
            jnp.sum(side * by_third),
            jnp.sum(axes[2] * by_third),
        )

    def coupling(self, x: RealScalar, y: RealScalar) -> RealScalar:
        """C: at small w the angle of (x, y) changes by w C / (x² + y²)."""
        return (
            (self.delta - self.alpha) * x**2
            + 2 * self.eta * x * y
            + (self.zeta - self.alpha) * y**2
        )

    def holding_torque(self, x: RealScalar, y: RealScalar) -> RealScalar:
        """Gyroscopic torque about b at w = 0, N m."""
        return (self.zeta - self.delta) * x * y + self.eta * (x**2 - y**2)

    def braked(self, w: RealScalar, x: RealScalar, y: RealScalar) -> RealScalar:
        """dx/dt, N m."""
        across = (self.alpha - self.zeta) * y - self.eta * x
        return -self.gamma * w**2 + w * across + self.gamma * y**2
