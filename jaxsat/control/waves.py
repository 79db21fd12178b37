"""Waves of the two rates of an oscillation: sines, and flat-topped waves of larger mean square.

With S = sin θ and C = cos θ a flat-topped wave is f = S / √(S² + q² C²), the sine of the phase χ
with tan χ = tan θ / q: a sine for q = 1 and a square wave for q = 0. Its mean square is 1 / (1 + q)
and its largest slope 1 / q.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import positive
from jaxsat.core.declaration.settling import LEAST_ROUNDNESS
from jaxsat.core.quotients import reciprocal

SINE = 1 - 1e-6
"""q of a sine, less what keeps the quotients of a flat-topped wave finite."""

SAMPLES = 1.5
"""Smallest q in parts of the phase of a control period: the change from -1 to 1 then takes about
three periods."""


class Wave(NamedTuple):
    """A wave f of mean square m at a phase θ: f, df/dθ, and two integrals without a mean.

    `fall` is that of -f, `ripple` that of f² - m.
    """

    value: RealScalar
    slope: RealScalar
    fall: RealScalar
    ripple: RealScalar


def wave_at(sine: RealScalar, cosine: RealScalar, roundness: RealScalar | None) -> Wave:
    """The flat-topped wave with q = `roundness` at a phase, or the sine for `None`."""
    if roundness is None:
        return Wave(sine, cosine, cosine, -sine * cosine / 2)
    q, flat = roundness, 1 - roundness
    square = flat * (1 + q)
    size = jnp.sqrt(sine**2 + (q * cosine) ** 2)
    inverse, root = reciprocal(size), jnp.sqrt(square)
    ahead = jnp.arctan2(flat * sine * cosine, q * cosine**2 + sine**2)  # χ - θ
    return Wave(
        sine * inverse,
        q**2 * cosine * inverse**3,
        jnp.arctan2(root * cosine, size) * reciprocal(root),
        -q * ahead * reciprocal(square),
    )


def twice_mean_square(roundness: RealScalar | None) -> RealScalar | float:
    """2 / (1 + q), the mean square relative to that of a sine, for q = `roundness`."""
    return 1.0 if roundness is None else 2 * reciprocal(1 + roundness)


class FlatTop(eqx.Module):
    """The flattest wave that torques and control periods make.

    Its largest slope is at most the `acceleration` (rad/s²), and it changes over some control
    periods of `period` (s).
    """

    acceleration: RealScalar = eqx.field(converter=positive("acceleration"))
    period: RealScalar = eqx.field(converter=positive("period"))

    def roundness(self, amplitude: RealScalar, frequency: RealScalar) -> RealScalar:
        """q of a wave of an `amplitude` (rad/s) and a `frequency` (rad/s)."""
        by_torque = amplitude * frequency / self.acceleration
        least = jnp.maximum(SAMPLES * frequency * self.period, LEAST_ROUNDNESS)
        return jnp.minimum(jnp.maximum(by_torque, least), SINE)
