"""The inner loop of the laws that track rates about the two driven axes."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.normal_form import NormalForm

RealScalar = Float[Array, ""]


def tracking_torque(
    form: NormalForm,
    omega: Float[Array, "3"],
    reference: Float[Array, "2"],
    reference_derivative: Float[Array, "2"],
    gain: RealScalar,
) -> Float[Array, "2"]:
    """S [dω_d/dt - gain (ω - ω_d)] minus the gyroscopic torque, N m.

    With it the rate error η = ω - ω_d of (p1, p2) obeys dη/dt = -gain η.
    """
    return form.torque(omega, reference_derivative - gain * (omega[:2] - reference))


def clipped(torque: Float[Array, "2"], limit: RealScalar) -> Float[Array, "2"]:
    """Each torque cut at ± `limit`."""
    return jnp.clip(torque, -limit, limit)
