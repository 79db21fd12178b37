"""The internal model of the disturbance: an oscillator tuned to it, equation (42)."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.checks import as_float, require_positive
from jaxsat.trigonometry import cos, sin


class OscillatorState(NamedTuple):
    """α and dα/dt of (42), one entry for each driven axis."""

    position: Float[Array, "2"]
    velocity: Float[Array, "2"]


class Turn(NamedTuple):
    """cos Ωt and sin Ωt: how far oscillators have turned by themselves since time zero."""

    cosine: Float[Array, "2"]
    sine: Float[Array, "2"]


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

    def turn(self, t: Float[Array, ""]) -> Turn:
        """How far the oscillators turn by themselves from time zero to `t` (s)."""
        angle = self.frequency * t
        return Turn(cos(angle), sin(angle))

    def turned(self, turn: Turn, back: OscillatorState) -> OscillatorState:
        """What a state turned back has become by the oscillators' own motion."""
        cosine, sine = turn
        return OscillatorState(
            (back.position * cosine + back.velocity * sine) / self.frequency,
            back.velocity * cosine - back.position * sine,
        )

    def turned_back(self, turn: Turn, state: OscillatorState) -> OscillatorState:
        """Ωα and dα/dt at time zero from which the oscillators by themselves come to a state.

        It changes by the rate error alone, so an integrator need not follow the oscillation.
        """
        cosine, sine = turn
        scaled = self.frequency * state.position
        return OscillatorState(
            scaled * cosine - state.velocity * sine, state.velocity * cosine + scaled * sine
        )

    def turned_back_rate(self, turn: Turn, rate_error: Float[Array, "2"]) -> OscillatorState:
        """Time derivative of the state turned back."""
        return OscillatorState(-rate_error * turn.sine, rate_error * turn.cosine)
