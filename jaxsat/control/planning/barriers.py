"""Limits of the torques, and the end of a plan within tolerances, as logarithmic barriers.

A limit s >= 0 of a torque with the multiplier z has s z = μ on the central path (primal-dual).
Newton's step for s and z is eliminated, so that only terms in the torques u remain: ½ curvature du²
+ gradient du.

The arrival ψ of a plan's last state (`Transcription.arrival`) is R e, where e lies in the unit
balls of tilt, turn and rate, and R are their radii. Each ball has the slack c = 1 - |e|² >= 0 with
a multiplier z, c z = μ on the central path. Newton's step for z is eliminated, so that terms in e
remain: ½ deᵀ H de + gᵀ de.
"""

from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.tolerances import Tolerances

Torques = Float[Array, " m"]

TO_BOUNDARY = 0.99
"""Largest share of the distance to a limit in one step."""

LEAVING = 1e3
"""Largest ratio of a multiplier to μ / s, in either direction."""


def longest_step(value: Array, change: Array) -> RealScalar:
    """The longest step, at most 1, after which positive values stay positive."""
    falling = change < 0
    steps = -TO_BOUNDARY * value / jnp.where(falling, change, -1.0)
    return jnp.minimum(1.0, jnp.min(jnp.where(falling, steps, 1.0)))


def stepped(x: Array, change: Array, step: RealScalar) -> Array:
    """The value after a step; unchanged for a step of zero, even if the change is NaN."""
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
        """The limit after steps of these lengths, its multiplier near the central path."""
        slack = stepped(self.slack, change.slack, primal)
        centred = mu / slack
        multiplier = stepped(self.multiplier, change.multiplier, dual)
        return Limit(slack, jnp.clip(multiplier, centred / LEAVING, centred * LEAVING))


class TorqueCost(eqx.Module):
    """Cost of the torques of one interval, with the barriers of their limits.

    |u| <= 1 are two limits. Two more make the cost the torques' sizes: over an interval of unit
    length the smallest t with -t <= u <= t. `limits` are 1 + u, 1 - u and, for sizes, t - u, t + u.
    """

    limits: tuple[Limit, ...]

    @staticmethod
    def free(u: Torques, mu: RealScalar) -> "TorqueCost":
        """The terms of torques without cost, on the central path of `mu`."""
        return TorqueCost(tuple(Limit(slack, mu / slack) for slack in (1 + u, 1 - u)))

    @staticmethod
    def of_sizes(u: Torques, mu: RealScalar, length: RealScalar) -> "TorqueCost":
        """Terms of torques with a cost of sizes, on the central path: t² = u² + 2 t μ / length."""
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
        """z/s of the limits of t, and the derivative of the cost by t."""
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
        """The cost after these steps; unchanged for a step of zero, even if the change is NaN."""
        pairs = zip(self.limits, change.limits, strict=True)
        return TorqueCost(tuple(limit.moved(other, primal, dual, mu) for limit, other in pairs))

    def value(
        self, change: "TorqueCost", step: RealScalar, mu: RealScalar, length: RealScalar
    ) -> RealScalar:
        """The cost and the barriers after a step of slacks."""
        pairs = zip(self.limits, change.limits, strict=True)
        slacks = [limit.slack + step * other.slack for limit, other in pairs]
        barriers = -mu * jnp.sum(jnp.log(reduce(jnp.multiply, slacks)))
        if len(slacks) == 2:
            return barriers
        return barriers + length * jnp.sum(slacks[2] + slacks[3]) / 2


BALLS = np.repeat(np.eye(3), (2, 1, 3), axis=0)
"""Incidence of the arrival's components and the balls: tilt, turn, rate."""

INSIDE = 0.9
"""Largest size of a guess's place, relative to a radius."""


def radii_of(tolerances: Tolerances, time_unit: RealScalar) -> Vector:
    """R of tilt, turn and rate times `time_unit` (s): twice the sines of half the angles, as ψ."""
    tilt = tolerances.w / jnp.sqrt(1 + tolerances.w**2)
    turn = jnp.sin(jnp.minimum(tolerances.z, jnp.pi) / 2)
    return jnp.stack([2 * tilt, 2 * turn, tolerances.relative_rate * time_unit])


def inside(place: Float[Array, "6"]) -> Float[Array, "6"]:
    """The place scaled back into the balls."""
    sizes = jnp.sqrt(place**2 @ BALLS)
    return place * (BALLS @ (INSIDE / jnp.maximum(sizes, INSIDE)))


def slacks(place: Float[Array, "6"]) -> Vector:
    """The slack c of each ball."""
    return 1 - place**2 @ BALLS


def barrier(place: Float[Array, "6"], mu: RealScalar) -> RealScalar:
    """Barrier cost of the balls at a place."""
    return -mu * jnp.sum(jnp.log(slacks(place)))


class EndTerms(NamedTuple):
    """H and g of the place e, and the radii R of its parts."""

    hessian: Float[Array, "6 6"]
    gradient: Float[Array, "6"]
    radii: Float[Array, "6"]

    @staticmethod
    def of(
        place: Float[Array, "6"], multipliers: Vector, radii: Vector, mu: RealScalar
    ) -> "EndTerms":
        """The terms at a place of the end, with the multipliers z."""
        slack = slacks(place)
        along = BALLS * place[:, None]
        curvature = jnp.diag(BALLS @ (2 * multipliers))
        hessian = curvature + 4 * (along * (multipliers / slack)[None]) @ along.T
        balls = jnp.asarray(BALLS)
        return EndTerms(hessian, balls @ (2 * mu / slack) * place, balls @ radii)


def longest_place_step(place: Float[Array, "6"], change: Float[Array, "6"]) -> RealScalar:
    """The longest step, at most 1, after which a share of every slack remains."""
    square = change**2 @ BALLS
    along = (place * change) @ BALLS
    root = jnp.sqrt(along**2 + square * TO_BOUNDARY * slacks(place))
    # |e + s d|² = 1 - (1 - share) c, by the form of the root without cancellation.
    reach = along + root
    steps = TO_BOUNDARY * slacks(place) / jnp.where(reach > 0, reach, 1.0)
    return jnp.minimum(1.0, jnp.min(jnp.where(reach > 0, steps, 1.0)))


def moved_multipliers(
    place: Float[Array, "6"],
    multipliers: Vector,
    change: Float[Array, "6"],
    primal: RealScalar,
    dual: RealScalar,
    mu: RealScalar,
) -> Vector:
    """z after Newton's step, near the central path of the place after the `primal` step."""
    slack = slacks(place)
    falling = 2 * (place * change) @ BALLS
    step = mu / slack - multipliers + multipliers / slack * falling
    centred = mu / slacks(stepped(place, change, primal))
    after = stepped(multipliers, step, dual)
    return jnp.clip(after, centred / LEAVING, centred * LEAVING)
