"""Limits of the torques as logarithmic barriers, with their multipliers (primal-dual).

A limit s >= 0 with the multiplier z has s z = μ on the central path. Newton's step for s and z is
eliminated, so that only terms in the torques u are left: ½ curvature du² + gradient du.
"""

from functools import reduce

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

RealScalar = Float[Array, ""]
Torques = Float[Array, " m"]

TO_BOUNDARY = 0.99
"""The share of the way to a limit that one step may go."""

LEAVING = 1e3
"""A multiplier stays within this factor of μ / s."""


def longest_step(value: Array, change: Array) -> RealScalar:
    """The longest step, at most 1, after which positive values are positive."""
    falling = change < 0
    steps = -TO_BOUNDARY * value / jnp.where(falling, change, -1.0)
    return jnp.minimum(1.0, jnp.min(jnp.where(falling, steps, 1.0)))


def stepped(x: Array, change: Array, step: RealScalar) -> Array:
    """After a step; without a step unchanged, also where the change is NaN."""
    return x + jnp.where(step > 0, step * change, 0.0)


class Limit(eqx.Module):
    """A limit of every torque in one interval: `slack` s and `multiplier` z."""

    slack: Torques
    multiplier: Torques

    def change(self, slack_change: Torques, mu: RealScalar) -> "Limit":
        """Newton's step of s and z, s changing by `slack_change`."""
        curvature = self.multiplier / self.slack
        change = mu / self.slack - self.multiplier - curvature * slack_change
        return Limit(slack_change, change)

    def moved(
        self, change: "Limit", primal: RealScalar, dual: RealScalar, mu: RealScalar
    ) -> "Limit":
        """After steps of these lengths, the multiplier near the central path."""
        slack = stepped(self.slack, change.slack, primal)
        centred = mu / slack
        multiplier = stepped(self.multiplier, change.multiplier, dual)
        return Limit(slack, jnp.clip(multiplier, centred / LEAVING, centred * LEAVING))


class TorqueCost(eqx.Module):
    """What the torques of one interval cost, with the barriers of their limits.

    |u| <= 1 are two limits. With two more the torques cost their sizes: over an interval of unit
    length the least t with -t <= u <= t. `limits` are 1 + u, 1 - u and, for sizes, t - u, t + u.
    """

    limits: tuple[Limit, ...]

    @staticmethod
    def free(u: Torques, mu: RealScalar) -> "TorqueCost":
        """Of torques that cost nothing, on the central path of `mu`."""
        return TorqueCost(tuple(Limit(slack, mu / slack) for slack in (1 + u, 1 - u)))

    @staticmethod
    def of_sizes(u: Torques, mu: RealScalar, length: RealScalar) -> "TorqueCost":
        """Of torques that cost their sizes, on the central path: t² = u² + 2 t μ / length."""
        ratio = mu / length
        size = ratio + jnp.sqrt(ratio**2 + u**2)
        slacks = (1 + u, 1 - u, size - u, size + u)
        return TorqueCost(tuple(Limit(slack, mu / slack) for slack in slacks))

    def terms(self, mu: RealScalar, length: RealScalar) -> tuple[Torques, Torques]:
        """Curvature and gradient of the cost in an interval of this length, t eliminated."""
        lower, upper = self.limits[:2]
        curvature = lower.multiplier / lower.slack + upper.multiplier / upper.slack
        gradient = mu / upper.slack - mu / lower.slack
        if len(self.limits) == 2:
            return curvature, gradient
        below, above, slope = self._size_terms(mu, length)
        both = below + above
        gradient = gradient + mu / self.limits[2].slack - mu / self.limits[3].slack
        gradient = gradient - (above - below) * slope / both
        return curvature + 4 * below * above / both, gradient

    def _size_terms(self, mu: RealScalar, length: RealScalar) -> tuple[Torques, Torques, Torques]:
        """z/s of the limits of t, and the slope of the cost by t."""
        below, above = self.limits[2:]
        slope = length - mu / below.slack - mu / above.slack
        return below.multiplier / below.slack, above.multiplier / above.slack, slope

    def change(self, du: Torques, mu: RealScalar, length: RealScalar) -> "TorqueCost":
        """Newton's step of slacks and multipliers, the torques changing by `du`."""
        slacks = (du, -du)
        if len(self.limits) > 2:
            below, above, slope = self._size_terms(mu, length)
            dt = -(slope + (above - below) * du) / (below + above)
            slacks = (*slacks, dt - du, dt + du)
        changed = zip(self.limits, slacks, strict=True)
        return TorqueCost(tuple(limit.change(slack, mu) for limit, slack in changed))

    def longest(self, change: "TorqueCost") -> tuple[RealScalar, RealScalar]:
        """The longest steps of slacks and of multipliers."""
        pairs = list(zip(self.limits, change.limits, strict=True))
        slacks = [longest_step(limit.slack, other.slack) for limit, other in pairs]
        multipliers = [longest_step(limit.multiplier, other.multiplier) for limit, other in pairs]
        return reduce(jnp.minimum, slacks), reduce(jnp.minimum, multipliers)

    def moved(
        self, change: "TorqueCost", primal: RealScalar, dual: RealScalar, mu: RealScalar
    ) -> "TorqueCost":
        """After steps of these lengths; without a step unchanged, also where the change is NaN."""
        pairs = zip(self.limits, change.limits, strict=True)
        return TorqueCost(tuple(limit.moved(other, primal, dual, mu) for limit, other in pairs))

    def value(
        self, change: "TorqueCost", step: RealScalar, mu: RealScalar, length: RealScalar
    ) -> RealScalar:
        """Cost and barriers after a step of slacks."""
        pairs = zip(self.limits, change.limits, strict=True)
        slacks = [limit.slack + step * other.slack for limit, other in pairs]
        barriers = -mu * jnp.sum(jnp.log(reduce(jnp.multiply, slacks)))
        if len(slacks) == 2:
            return barriers
        return barriers + length * jnp.sum(slacks[2] + slacks[3]) / 2
