"""The end of a plan within tolerances of rest: three balls with logarithmic barriers.

The arrival ψ of a plan's last state (`Transcription.arrival`) is R e, where e lies in the unit
balls of tilt, turn and rate, and R are their radii. Each ball has the slack c = 1 - |e|² >= 0 with
a multiplier z, c z = μ on the central path. Newton's step for z is eliminated, so that terms in e
are left: ½ deᵀ H de + gᵀ de.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.control.planning.barrier import LEAVING, TO_BOUNDARY, stepped
from jaxsat.core.tolerances import Tolerances

RealScalar = Float[Array, ""]

BALLS = np.repeat(np.eye(3), (2, 1, 3), axis=0)
"""Which part of the arrival belongs to which ball: tilt, turn, rate."""

INSIDE = 0.9
"""Of a radius, where the place of a guess is at most."""


def radii_of(tolerances: Tolerances, time_unit: RealScalar) -> Float[Array, "3"]:
    """R of tilt, turn and rate times `time_unit` (s): twice the sines of half the angles, as ψ."""
    tilt = tolerances.w / jnp.sqrt(1 + tolerances.w**2)
    turn = jnp.sin(jnp.minimum(tolerances.z, jnp.pi) / 2)
    return jnp.stack([2 * tilt, 2 * turn, tolerances.relative_rate * time_unit])


def inside(place: Float[Array, "6"]) -> Float[Array, "6"]:
    """The place drawn back into the balls."""
    sizes = jnp.sqrt(place**2 @ BALLS)
    return place * (BALLS @ (INSIDE / jnp.maximum(sizes, INSIDE)))


def slacks(place: Float[Array, "6"]) -> Float[Array, "3"]:
    """c of each ball."""
    return 1 - place**2 @ BALLS


def barrier(place: Float[Array, "6"], mu: RealScalar) -> RealScalar:
    """What the balls cost at a place."""
    return -mu * jnp.sum(jnp.log(slacks(place)))


class EndTerms(NamedTuple):
    """H and g of the place e, and the radii R of its parts."""

    hessian: Float[Array, "6 6"]
    gradient: Float[Array, "6"]
    radii: Float[Array, "6"]

    @staticmethod
    def of(
        place: Float[Array, "6"],
        multipliers: Float[Array, "3"],
        radii: Float[Array, "3"],
        mu: RealScalar,
    ) -> "EndTerms":
        """At a place with the multipliers z."""
        slack = slacks(place)
        along = BALLS * place[:, None]
        curvature = jnp.diag(BALLS @ (2 * multipliers))
        hessian = curvature + 4 * (along * (multipliers / slack)[None]) @ along.T
        balls = jnp.asarray(BALLS)
        return EndTerms(hessian, balls @ (2 * mu / slack) * place, balls @ radii)


def longest_place_step(place: Float[Array, "6"], change: Float[Array, "6"]) -> RealScalar:
    """The longest step, at most 1, after which a share of every slack is left."""
    square = change**2 @ BALLS
    along = (place * change) @ BALLS
    root = jnp.sqrt(along**2 + square * TO_BOUNDARY * slacks(place))
    # |e + s d|² = 1 - (1 - share) c, by the form of the root without cancellation.
    reach = along + root
    steps = TO_BOUNDARY * slacks(place) / jnp.where(reach > 0, reach, 1.0)
    return jnp.minimum(1.0, jnp.min(jnp.where(reach > 0, steps, 1.0)))


def moved_multipliers(
    place: Float[Array, "6"],
    multipliers: Float[Array, "3"],
    change: Float[Array, "6"],
    taken: RealScalar,
    dual: RealScalar,
    mu: RealScalar,
) -> Float[Array, "3"]:
    """z after Newton's step, near the central path of the place after the step `taken`."""
    slack = slacks(place)
    falling = 2 * (place * change) @ BALLS
    step = mu / slack - multipliers + multipliers / slack * falling
    centred = mu / slacks(stepped(place, change, taken))
    found = stepped(multipliers, step, dual)
    return jnp.clip(found, centred / LEAVING, centred * LEAVING)
