"""Numbers that a trajectory is judged by. All work on histories at fixed times and under vmap."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.checks import as_float


class Tolerances(eqx.Module):
    """When a spacecraft counts as settled: |w|, |z| (rad, wrapped) and |ω_r| (rad/s) below these.

    The relative rate is ω - C (0, -ω0, 0)ᵀ, the rate at which the attitude really changes.
    """

    w: Float[Array, ""] = eqx.field(converter=as_float, default=0.05)
    z: Float[Array, ""] = eqx.field(converter=as_float, default=0.05)
    relative_rate: Float[Array, ""] = eqx.field(converter=as_float, default=1e-3)


def wrapped(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """An angle brought into [-π, π), rad."""
    return angle - 2 * jnp.pi * jnp.floor(angle / (2 * jnp.pi) + 0.5)


def within(
    w: Float[Array, "times 2"],
    z: Float[Array, " times"],
    relative_rate: Float[Array, "times 3"],
    tolerances: Tolerances,
) -> Bool[Array, " times"]:
    """At which times all tolerances are met; never where a run has ended early (NaN)."""
    return (
        (jnp.sum(w**2, axis=-1) < tolerances.w**2)
        & (jnp.abs(wrapped(z)) < tolerances.z)
        & (jnp.sum(relative_rate**2, axis=-1) < tolerances.relative_rate**2)
    )


def settling_time(
    times: Float[Array, " times"], good: Bool[Array, " times"], before: float = 0.9
) -> Float[Array, ""]:
    """First time from which `good` holds to the end, s.

    Infinite if it does not hold at the end, or begins after the fraction `before` of the horizon:
    what has only just become small has not been shown to stay so.
    """
    holds_to_end = jnp.flip(jnp.cumprod(jnp.flip(good.astype(int)))).astype(bool)
    first = times[jnp.argmax(holds_to_end)]
    latest = times[0] + before * (times[-1] - times[0])
    return jnp.where(holds_to_end[-1] & (first <= latest), first, jnp.inf)


def effort(times: Float[Array, " times"], torque: Float[Array, "times 3"]) -> Float[Array, ""]:
    """∫ Σ|T_i| dt by the trapezoidal rule, N m s: the angular impulse the thrusters spend."""
    total = jnp.sum(jnp.abs(torque), axis=-1)
    return jnp.sum((total[1:] + total[:-1]) / 2 * jnp.diff(times))
