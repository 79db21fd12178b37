"""The internal model of the disturbance: an oscillator tuned to it, equation (42)."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.integrating_factor import AbstractIntegratingFactor
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.trigonometry import cos, sin


class OscillatorState(NamedTuple):
    """α and dα/dt of (42), one entry for each driven axis."""

    position: Float[Array, "2"]
    velocity: Float[Array, "2"]


class Rotation(AbstractIntegratingFactor):
    """Turns (Ωα, dα/dt) by Ωt, as the oscillators by themselves do from time zero to t.

    `cosine` and `sine` are those of Ωt, `frequency` is Ω (rad/s).
    """

    cosine: Float[Array, "2"]
    sine: Float[Array, "2"]
    frequency: Float[Array, "2"]

    def into_frame(self, memory: OscillatorState) -> OscillatorState:
        """Ωα and dα/dt at time zero from which the oscillators by themselves come to a state."""
        cosine, sine, scaled = self.cosine, self.sine, self.frequency * memory.position
        return OscillatorState(
            scaled * cosine - memory.velocity * sine, memory.velocity * cosine + scaled * sine
        )

    def out_of_frame(self, framed: OscillatorState) -> OscillatorState:
        """α and dα/dt from those at time zero."""
        cosine, sine = self.cosine, self.sine
        return OscillatorState(
            (framed.position * cosine + framed.velocity * sine) / self.frequency,
            framed.velocity * cosine - framed.position * sine,
        )

    def rate_in_frame(self, rate_error: Float[Array, "2"]) -> OscillatorState:
        """The rate error, turned."""
        return OscillatorState(-rate_error * self.sine, rate_error * self.cosine)


class InternalModel(eqx.Module):
    """Two oscillators d²α/dt² + Ω² α = η driven by the rate error.

    Fed back through dα/dt they cancel a disturbance of the frequencies Ω (`frequency`, rad/s,
    shape (2,)), whatever its amplitude and phase.
    """

    frequency: Float[Array, "2"] = eqx.field(converter=as_float)

    def __check_init__(self):
        require_positive("frequency", self.frequency)

    def init(self) -> OscillatorState:
        """At rest."""
        return OscillatorState(jnp.zeros_like(self.frequency), jnp.zeros_like(self.frequency))

    def rate(self, state: OscillatorState, rate_error: Float[Array, "2"]) -> OscillatorState:
        """Time derivative of the oscillators."""
        return OscillatorState(state.velocity, rate_error - self.frequency**2 * state.position)

    def advance(
        self, state: OscillatorState, rate_error: Float[Array, "2"], period: Float[Array, ""]
    ) -> OscillatorState:
        """The oscillators after `period` seconds with the rate error held: the exact solution."""
        angle = self.frequency * period
        c, s = jnp.cos(angle), jnp.sin(angle)
        rest = rate_error / self.frequency**2
        offset = state.position - rest
        return OscillatorState(
            rest + offset * c + state.velocity * s / self.frequency,
            -offset * self.frequency * s + state.velocity * c,
        )

    def integrating_factor(self, t: Float[Array, ""]) -> Rotation:
        """How far the oscillators have turned by themselves at time `t` (s)."""
        angle = self.frequency * t
        return Rotation(cos(angle), sin(angle), self.frequency)
