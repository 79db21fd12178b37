"""The inner loop of the laws that track rates about the two driven axes."""

import jax.numpy as jnp
from jaxtyping import Array, Float

RealScalar = Float[Array, ""]


def coupling(moments: Float[Array, "3"]) -> RealScalar:
    """c = (J1 - J2) / J3, by which dω3/dt = c ω1 ω2 without a third torque, equation (37)."""
    return (moments[0] - moments[1]) / moments[2]


def gyroscopic_torque(moments: Float[Array, "3"], omega: Float[Array, "3"]) -> Float[Array, "2"]:
    """((J2 - J3) ω2 ω3, (J3 - J1) ω3 ω1), N m, what (37) adds to the first two torques."""
    j1, j2, j3 = moments
    return jnp.stack([(j2 - j3) * omega[1], (j3 - j1) * omega[0]]) * omega[2]


def tracking_torque(
    moments: Float[Array, "3"],
    omega: Float[Array, "3"],
    reference: Float[Array, "2"],
    reference_derivative: Float[Array, "2"],
    gain: RealScalar,
) -> Float[Array, "2"]:
    """J [dω_d/dt - gain (ω - ω_d)] minus the gyroscopic torque, N m.

    With it the rate error η = ω - ω_d obeys dη/dt = -gain η.
    """
    wanted = reference_derivative - gain * (omega[:2] - reference)
    return moments[:2] * wanted - gyroscopic_torque(moments, omega)


def clipped(torque: Float[Array, "2"], limit: RealScalar) -> Float[Array, "2"]:
    """Each torque cut at ± `limit`."""
    return jnp.clip(torque, -limit, limit)
