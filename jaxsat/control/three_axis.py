"""Three-axis stabilisation with two torques: equations (40), (41) and (42).

(42) is the internal model of the disturbance, an oscillator tuned to it.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.controller import (
    AbstractBacksteppingLaw,
    AbstractIntegratingFactor,
    LawContext,
    Memory,
)
from jaxsat.core.array_types import Pair, RealScalar
from jaxsat.core.checks import all_positive, as_float, not_negative, positive, require_positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.paper import THREE_AXIS
from jaxsat.core.quotients import quotient, reciprocal
from jaxsat.core.smooth import Width, as_width, sat
from jaxsat.core.trigonometry import cos, sin
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class OscillatorState(NamedTuple):
    """α and dα/dt of (42), one entry for each driven axis."""

    position: Pair
    velocity: Pair


class Rotation(AbstractIntegratingFactor):
    """Rotation of (Ωα, dα/dt) by Ωt, the free motion of the oscillators from time zero to t.

    `cosine` and `sine` are those of Ωt, `frequency` is Ω (rad/s).
    """

    cosine: Pair
    sine: Pair
    frequency: Pair

    def into_frame(self, memory: OscillatorState) -> OscillatorState:
        """Ωα and dα/dt at time zero from which free oscillators reach a state."""
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

    def rate_in_frame(self, rate_error: Pair) -> OscillatorState:
        """The rate error, rotated."""
        return OscillatorState(-rate_error * self.sine, rate_error * self.cosine)


class InternalModel(eqx.Module):
    """Two oscillators d²α/dt² + Ω² α = η driven by the rate error.

    Feedback of dα/dt cancels a disturbance of the frequencies Ω (`frequency`, rad/s, shape (2,)),
    whatever its amplitude and phase.
    """

    frequency: Pair = eqx.field(converter=positive("frequency"))

    def init(self) -> OscillatorState:
        """The state of oscillators at rest."""
        return OscillatorState(jnp.zeros_like(self.frequency), jnp.zeros_like(self.frequency))

    def rate(self, state: OscillatorState, rate_error: Pair) -> OscillatorState:
        """Time derivative of the oscillators."""
        return OscillatorState(state.velocity, rate_error - self.frequency**2 * state.position)

    def advance(
        self, state: OscillatorState, rate_error: Pair, period: RealScalar
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

    def integrating_factor(self, t: RealScalar) -> Rotation:
        """The free rotation of the oscillators at time `t` (s)."""
        angle = self.frequency * t
        return Rotation(cos(angle), sin(angle), self.frequency)


class ThreeAxisLaw(AbstractBacksteppingLaw):
    """Brings the body frame onto the orbit frame, in (w, z) parameters.

    Gains, all positive: `k3` and `mu` in 1/s, `a` (no unit) bounds the part of the reference that
    steers z, `k4` in N m s, one number or one for each axis. `internal_model` cancels a periodic
    disturbance; None leaves it out. `attitude_weight` (N m) multiplies the attitude terms of (42),
    1 as printed. `saturation_width` in (0, 1] rounds the corner of sat, which is sharp without, and
    `tilt_width` δ puts |w|² + δ² under the fraction of (41), 0 as printed. `saturated` fixes the
    sharp sat to one side of each corner, see `smooth_piece`.
    """

    declaration: ClassVar[LawDeclaration] = THREE_AXIS

    model: RigidBody
    k3: RealScalar = eqx.field(converter=positive("k3"))
    mu: RealScalar = eqx.field(converter=positive("mu"))
    a: RealScalar = eqx.field(converter=positive("a"))
    k4: RealScalar | Pair = eqx.field(converter=positive("k4"))
    internal_model: InternalModel | None = None
    attitude_weight: RealScalar = eqx.field(converter=not_negative("attitude_weight"), default=1.0)
    saturation_width: Width = eqx.field(converter=as_width, default=None)
    tilt_width: RealScalar = eqx.field(converter=not_negative("tilt_width"), default=0.0)
    saturated: Bool[Array, "2"] | None = None

    def __check_init__(self):
        if self.saturation_width is not None:
            require_positive("saturation_width", self.saturation_width, zero_allowed=True)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "ThreeAxisLaw":
        """The law from a scenario's table."""
        frequency = values["internal_model_frequency_rad_s"] or context.disturbance_frequency[:2]
        return cls(
            context.model,
            values["k3"],
            values["mu"],
            values["a"],
            values["k4"],
            InternalModel(as_float(frequency)) if values["internal_model"] else None,
            values["attitude_weight_N_m"],
            values["saturation_width"],
            values["tilt_width"],
        )

    def init(self, state: PlantState) -> Memory:
        """The internal model at rest."""
        return None if self.internal_model is None else self.internal_model.init()

    def is_smooth(self) -> bool:
        """Whether the torque is smooth: with both widths above zero."""
        width = self.saturation_width
        return width is not None and all_positive(width, self.tilt_width)

    def event_functions(self, state: PlantState) -> Float[Array, " m"]:
        """x² - a² for each argument x of a sharp sat: positive where it saturates."""
        steering = self._steering(state)
        return steering[:0] if self.saturation_width is not None else steering**2 - self.a**2

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ThreeAxisLaw":
        """The law with each sat fixed to saturation (true) or not."""
        return self if not signs.size else dataclasses.replace(self, saturated=signs)

    def relative_reference_rate(self, state: PlantState) -> Pair:
        """Equation (40) with the saturation of (41): (ω_r1d, ω_r2d), rad/s.

        ω_r1d = -k3 w1 / (1 + |w|²) + μ sat(q w2, a), ω_r2d = -k3 w2 / (1 + |w|²) - μ sat(q w1, a)
        with q = (z + ω_r3 / μ) / |w|², and zero for the second term where w = 0.
        """
        w = state.attitude.as_wz().w
        square = w[0] * w[0] + w[1] * w[1]
        bounded = sat(self._steering(state), self.a, self.saturation_width, self.saturated)
        pull = quotient(self.k3, 1 + square)
        return self.mu * bounded - pull * w

    def _steering(self, state: PlantState) -> Pair:
        attitude = state.attitude.as_wz()
        w1, w2 = attitude.w
        relative_rate3 = self.model.relative_rate(state)[2]
        divisor = w1 * w1 + w2 * w2 + self.tilt_width**2
        turn = attitude.z + relative_rate3 * reciprocal(self.mu)
        q = quotient(turn, jnp.where(divisor > 0, divisor, 1.0))
        return q * jnp.stack([w2, -w1])

    def reference_rate(self, state: PlantState) -> Pair:
        """Equation (41): the relative reference plus the orbit frame's own rate, by (11)."""
        frame_rate = self.model.orbit.frame_rate(state.attitude)
        return self.relative_reference_rate(state) + frame_rate[:2]

    def feedback(self, state: PlantState, rate_error: Pair, memory: Memory) -> Pair:
        """The right-hand side of (43): attitude terms, -k4 η and the internal model's -k4 dα/dt."""
        attitude = state.attitude.as_wz()
        (w1, w2), z = attitude.w, attitude.z
        square = w1**2 + w2**2
        attitude_terms = jnp.stack([-w1 * (1 + square) + w2 * z, -w2 * (1 + square) - w1 * z])
        damped = rate_error if self.internal_model is None else rate_error + memory.velocity
        return self.attitude_weight * attitude_terms - self.k4 * damped

    def memory_rate(self, rate_error: Pair, memory: Memory) -> Memory:
        """Rate of the internal model of (42)."""
        return None if self.internal_model is None else self.internal_model.rate(memory, rate_error)

    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the internal model."""
        return None if self.internal_model is None else self.internal_model.integrating_factor(t)

    def advance(self, rate_error: Pair, memory: Memory, period: RealScalar) -> Memory:
        """The memory after `period` seconds with the rate error held, for sampled use."""
        if self.internal_model is None:
            return None
        return self.internal_model.advance(memory, rate_error, period)

    def lyapunov(
        self, state: PlantState, memory: Memory, unmodelled: Pair, unmodelled_rate: Pair
    ) -> RealScalar:
        """V of the proof of (42): V2 + Σ J_i η_i² / 2 + k4 Σ (dθ_i/dt² + Ω_i² θ_i²) / 2.

        θ is the internal model's error: k4 dθ/dt = k4 dα/dt - ξ for the unmodelled torque ξ, and
        as ξ oscillates at Ω, k4 θ = k4 α + (dξ/dt) / Ω².
        """
        attitude = state.attitude.as_wz()
        error = self.rate_error(state)
        value = self.attitude_weight * (jnp.sum(attitude.w**2) + attitude.z**2 / 2)
        value = value + jnp.sum(self.model.spacecraft.moments[:2] * error**2) / 2
        if self.internal_model is None:
            return value
        frequency = self.internal_model.frequency
        theta = memory.position + unmodelled_rate / (self.k4 * frequency**2)
        theta_rate = memory.velocity - unmodelled / self.k4
        return value + jnp.sum(self.k4 * (theta_rate**2 + frequency**2 * theta**2)) / 2
