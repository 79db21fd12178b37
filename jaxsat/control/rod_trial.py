"""Dipoles that tell how much magnetorquers make, and turn nothing while all work."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.quotients import SMALLEST, length
from jaxsat.spacecraft.magnetorquers import MagneticSteering

TRIAL = 0.05
"""Trial dipole, over the least limit of a magnetorquer."""

SPANNED = 0.01
"""Part of the field beyond the span of magnetorquers that counts as none: shares of turned axes are
approximate."""


def trial_size(steering: MagneticSteering) -> RealScalar:
    """Return the size of a trial dipole, A m²."""
    return TRIAL * jnp.min(steering.dipole_limit)


def trial_dipoles(
    steering: MagneticSteering, field: Vector, besides: Float[Array, " k"], sense: RealScalar
) -> Float[Array, " k"]:
    """Return dipoles (A m²) whose sum is along or, by its `sense`, against the field (T).

    It makes no torque, but for what one of them lacks. They leave room for dipoles `besides`, and
    are zero where working magnetorquers do not span the field, as two do not.
    """
    along = steering.shares @ field
    beyond = field - steering.axes @ along
    spanned = jnp.sum(beyond**2) < SPANNED**2 * jnp.sum(field**2)
    trial = trial_size(steering) * sense * along / length(field)
    room = steering.dipole_limit - jnp.abs(besides)
    part = jnp.min(room / jnp.maximum(jnp.abs(trial), SMALLEST))
    return jnp.where(spanned, jnp.clip(part, 0.0, 1.0), 0.0) * trial
