"""Quaternion feedback with three torques: the law of a fully actuated spacecraft.

Wie, Weiss, Arapostathis, J. Guidance, Control, and Dynamics 12(3), 1989; the rate limit of a slew
as in Wie and Lu, J. Guidance, Control, and Dynamics 18(6), 1995.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.controller import LawContext
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.core.checks import as_optional_float, positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.three_torques import QUATERNION_FEEDBACK
from jaxsat.core.quotients import SMALLEST, share_within
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.wheels import wheel_momentum


class QuaternionFeedbackMemory(NamedTuple):
    """The last reference rate relative to the orbit frame, rad/s."""

    reference: Vector


class QuaternionFeedback(AbstractSampledController):
    """u = ω × (Jω + A h) + J (ω_f × ω_r) - 2ζΩ J (ω_r - ω_d), ω_d = -(Ω / ζ) sgn(q0) q,
    rate-limited.

    ω_f is the orbit frame's rate and ω_r the one relative to it, in body axes; q the vector part of
    the attitude. Small errors then obey dθ²/dt² + 2ζΩ dθ/dt + Ω² θ = 0 about each axis.
    `natural_frequency` is Ω (rad/s), `damping` ζ; |ω_d| is at most `max_rate` (rad/s, may be
    infinite). `period` is in s. The first two terms cancel the rotation of body and orbit frame,
    with the measured momenta h of wheels along `wheel_axes` A, None without wheels.
    """

    declaration: ClassVar[LawDeclaration] = QUATERNION_FEEDBACK

    model: RigidBody
    natural_frequency: RealScalar = eqx.field(converter=positive("natural_frequency"))
    damping: RealScalar = eqx.field(converter=positive("damping"))
    max_rate: RealScalar = eqx.field(converter=positive("max_rate"))
    period: RealScalar = eqx.field(converter=positive("period"))
    wheel_axes: Float[Array, "3 wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "QuaternionFeedback":
        """The law from a scenario's table."""
        rate = values["max_rate_rad_s"]
        return cls(
            model=context.model,
            natural_frequency=values["natural_frequency_rad_s"],
            damping=values["damping"],
            max_rate=jnp.inf if rate is None else rate,
            period=values["period_s"],
            wheel_axes=context.wheel_axes,
        )

    def init(self, state: PlantState) -> QuaternionFeedbackMemory:
        """The initial memory, without a reference."""
        return QuaternionFeedbackMemory(jnp.zeros_like(state.omega))

    def step(
        self, t: RealScalar, state: PlantState, memory: QuaternionFeedbackMemory
    ) -> tuple[Vector, QuaternionFeedbackMemory]:
        """The torque, N m."""
        inertia = self.model.spacecraft.inertia
        frame = self.model.orbit.frame_rate(state.attitude)
        relative = state.omega - frame
        reference = self._reference_rate(state)
        turning = jnp.cross(frame, relative)
        pull = 2 * self.damping * self.natural_frequency * (relative - reference)
        momentum, stored = inertia @ state.omega, wheel_momentum(state)
        if self.wheel_axes is not None and stored is not None:
            momentum = momentum + self.wheel_axes @ stored
        torque = jnp.cross(state.omega, momentum) + inertia @ (turning - pull)
        return torque, QuaternionFeedbackMemory(reference)

    def _reference_rate(self, state: PlantState) -> Vector:
        quaternion = state.attitude.as_quaternion().q
        shorter = jnp.where(quaternion[0] < 0, -1.0, 1.0)
        rate = -(self.natural_frequency / self.damping) * shorter * quaternion[1:]
        size = jnp.sqrt(jnp.sum(rate**2) + SMALLEST)
        return rate * share_within(self.max_rate, size)

    def rate_error(self, state: PlantState, memory: QuaternionFeedbackMemory) -> Pair:
        """ω_r - ω_d about the first two axes, rad/s."""
        return (self.model.relative_rate(state) - memory.reference)[:2]
