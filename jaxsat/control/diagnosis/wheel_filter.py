"""Momenta of wheels that were not commanded: innovations of one filter for each wheel.

A wheel's tachometer tells its momentum h relative to the body. Its motor is commanded the torque c
on the body, friction f brakes the rotor, so that dh/dt = -(c + f) - J_w a·dω/dt with the inertia
J_w of a rotor about its axis a. The last term is known from the rates, so what failures leave is
told by each wheel alone, whatever the body does.
"""

from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.diagnosis.isolation import (
    LEAST_PART,
    MOST_FRICTION,
    OF_WHEELS,
    AnyResidual,
    DiagnosedKind,
    Hypotheses,
)
from jaxsat.control.diagnosis.residual import (
    RESTLESSNESS,
    TEST_SIGMAS,
    TRACKING,
    AbstractResidualFilter,
    ActuatorCondition,
)
from jaxsat.core.checks import as_float, require_positive
from jaxsat.spacecraft import Wheels

RealScalar = Float[Array, ""]
OfEach = Float[Array, " m"]

STILL = 4.0
"""Sigmas of a momentum that may be none."""

JUMP = 3.0
"""Times what a motor at full torque changes in a period: no motor does that."""

LEAST_NOISE = 1e-3
"""Of what a motor at full torque changes in a period: of momenta told without noise."""

NEAR_LIMIT = 0.98
"""Of the largest momentum: from there on a motor may make less than it is commanded."""


class WheelReading(NamedTuple):
    """The momenta that tachometers tell, N m s, and the rate of the body, rad/s."""

    momentum: OfEach
    rate: Float[Array, "3"]


class WheelMemory(NamedTuple):
    """Filtered momenta (N m s), their variances, and each wheel's signatures in them (N m s).

    `seized` tells which wheels stood still at once and have not turned since. `taken` (N m s) is
    the momentum J_w a·ω that rotors had with the body, None without a rotor inertia.
    """

    momentum: OfEach
    variance: OfEach
    loss: OfEach
    flow: OfEach
    seized: Bool[Array, " m"]
    started: Bool[Array, ""]
    taken: OfEach | None = None


class WheelResidual(NamedTuple):
    """Innovations (N m s) and their variances, and the signatures in them, of each wheel alone.

    `driven`, from -1 to 1, tells which wheels are driven from rest, and which way.
    """

    innovation: OfEach
    variance: OfEach
    loss: Float[Array, "m m"]
    flow: Float[Array, "m m"]
    driven: OfEach
    steady: None = None

    def doubt(self, uncertainty: RealScalar) -> OfEach:
        """Standard deviations (N m s) if the part `uncertainty` may be an error of the model."""
        return jnp.sqrt(self.variance + uncertainty**2 * self.innovation**2)


class WheelFilter(AbstractResidualFilter):
    """A Kalman filter of each wheel's momentum.

    `wheels` are those that the law believes in, with a torque limit each. `momentum_noise` (N m s)
    is the standard deviation of each tachometer. Commanded and friction torques are believed to be
    wrong by the part `uncertainty` of themselves; friction of unknown sign, near rest, is in doubt
    as a whole. What is commanded is an impulse (N m s) on the body.
    """

    hypotheses: ClassVar[Hypotheses] = OF_WHEELS

    wheels: Wheels
    momentum_noise: OfEach = eqx.field(converter=as_float)
    uncertainty: RealScalar = eqx.field(converter=as_float)

    def __check_init__(self):
        for name in ("momentum_noise", "uncertainty"):
            require_positive(name, getattr(self, name))
        if self.wheels.torque_limit is None:
            raise ValueError("Argument `wheels` must have a torque limit each.")

    @property
    def count(self) -> int:
        """How many wheels there are."""
        return self.wheels.count

    @property
    def noise(self) -> OfEach:
        """Standard deviation of each wheel's measured momentum, N m s."""
        return self.momentum_noise

    @property
    def full(self) -> OfEach:
        """The full torque of each motor, N m."""
        limit = self.wheels.torque_limit
        assert limit is not None
        return limit

    def init(self, reading: OfEach | WheelReading) -> WheelMemory:
        """The filter's memory at the first reading of the tachometers."""
        momentum, taken = self._told(reading)
        none, no = jnp.zeros_like(momentum), jnp.array(False)
        return WheelMemory(momentum, self.momentum_noise**2, none, none, none > 0, no, taken)

    def _told(self, reading: OfEach | WheelReading) -> tuple[OfEach, OfEach | None]:
        """The momenta relative to the body, and those that rotors have with it."""
        if not isinstance(reading, WheelReading):
            return reading, None
        wheels = self.wheels
        if wheels.rotor_inertia is None:
            return reading.momentum, None
        return reading.momentum, wheels.rotor_inertia * (wheels.axes.T @ reading.rate)

    def restarted(
        self, memory: WheelMemory, verdict: Bool[Array, ""], alarm: Bool[Array, ""]
    ) -> WheelMemory:
        """The memory after a verdict or an alarm; a wheel that seized is followed no further."""
        return memory._replace(started=memory.started & ~(verdict | alarm))

    def friction(self, momentum: OfEach, condition: ActuatorCondition) -> OfEach:
        """The size of what brakes each wheel at these momenta while it turns, N m.

        `ActuatorCondition.flow` is the part of a motor's full torque that does so besides, less
        than zero where that drives the wheel on.
        """
        wheels = self.wheels
        torque = condition.flow * self.full
        if wheels.coulomb_friction is not None:
            torque = torque + wheels.coulomb_friction
        if wheels.viscous_friction is not None:
            torque = torque + wheels.decay * jnp.abs(momentum)
        return torque

    def side(self, momentum: OfEach) -> OfEach:
        """Which way each wheel turns, from -1 to 1: a part of it near rest."""
        return jnp.clip(momentum / (STILL * self.momentum_noise), -1.0, 1.0)

    def held(self, momentum: OfEach, torque: OfEach, condition: ActuatorCondition) -> OfEach:
        """What of a motor torque (N m) friction holds back: of a wheel at rest, up to its size."""
        friction = jnp.maximum(self.friction(momentum, condition), 0.0)
        return (1 - jnp.abs(self.side(momentum))) * jnp.clip(torque, -friction, friction)

    def step(
        self,
        reading: OfEach | WheelReading,
        commanded: OfEach,
        condition: ActuatorCondition,
        period: RealScalar,
        memory: WheelMemory,
    ) -> tuple[WheelResidual, WheelMemory]:
        """The residuals of the period that ends with what is read; rates count with rotors."""
        reading, taken = self._told(reading)
        left_behind = 0.0
        if taken is not None and memory.taken is not None:
            left_behind = taken - memory.taken
        noise, started, before = self.momentum_noise**2, memory.started, memory.momentum
        full = period * self.full
        motor = condition.part * commanded
        driving = motor + left_behind
        held = period * self.held(before, driving / period, condition)
        motor = motor - period * self.held(before, motor / period, condition)
        friction, side = period * self.friction(before, condition), self.side(before)
        braked = friction * side
        expected = before - (driving - held) - braked
        limit = self.wheels.momentum_limit
        doubt = self.uncertainty**2 * (motor**2 + left_behind**2 + braked**2)
        rests = jnp.abs(before) < jnp.abs(motor) + jnp.abs(friction) + STILL * self.momentum_noise
        doubt = doubt + jnp.where(rests, friction**2, 0.0)
        if limit is not None:
            near = jnp.abs(before) > NEAR_LIMIT * limit - jnp.abs(motor)
            doubt = doubt + jnp.where(near, motor**2, 0.0)
            expected = jnp.clip(expected, -limit, limit)
        predicted = memory.variance + RESTLESSNESS * noise + doubt
        variance = predicted + noise
        gain = jnp.where(started, predicted / variance, 1.0)
        innovation = jnp.where(started, reading - expected, 0.0)
        returned = (condition.part - 1) * commanded
        missing = jnp.where(condition.failed, returned, motor)
        loss = jnp.where(started, memory.loss + missing, 0.0)
        flow = jnp.where(started, memory.flow - full * side, 0.0)
        left = 1 - gain
        still = jnp.abs(reading) < STILL * self.momentum_noise
        jumped = jnp.abs(innovation) > JUMP * full + STILL * jnp.sqrt(variance)
        following = WheelMemory(
            jnp.where(started, expected + gain * innovation, reading),
            jnp.where(started, left * predicted, noise),
            left * loss,
            left * flow,
            still & (jumped | memory.seized),
            jnp.array(True),
            taken,
        )
        driven = (1 - jnp.abs(side)) * motor / (jnp.abs(motor) + self.momentum_noise)
        residual = WheelResidual(innovation, variance, jnp.diag(loss), jnp.diag(flow), driven)
        return residual, following

    def tracked(
        self,
        residual: AnyResidual,
        condition: ActuatorCondition,
        period: RealScalar,
        quiet: Bool[Array, ""],
    ) -> ActuatorCondition:
        """The condition with the friction of wheels that are braked too much corrected.

        One that turns tells it by how fast it slows, one that does not turn though it is driven
        has more.
        """
        del quiet
        full, flow = period * self.full, jnp.diagonal(residual.flow)
        driven = cast(WheelResidual, residual).driven
        signature = jnp.where(jnp.abs(flow) > full, flow, full * driven)
        error = residual.innovation * signature / (signature**2 + full**2)
        braked = ~condition.failed & (condition.flow > 0)
        known = jnp.clip(condition.flow + TRACKING * error, LEAST_PART, MOST_FRICTION)
        return condition._replace(flow=jnp.where(braked, known, condition.flow))

    def test_command(self, period: RealScalar, sigma: RealScalar | OfEach) -> OfEach:
        """Torques (N m) that stand out of errors of a momentum (N m s) within a period."""
        return jnp.minimum(TEST_SIGMAS * sigma / period, self.full)

    def named(
        self, kind: Int[Array, ""], actuator: Int[Array, ""], memory: WheelMemory
    ) -> Int[Array, ""]:
        """A dead wheel that stood still at once is one that has stopped."""
        stopped = (kind == DiagnosedKind.DEAD) & memory.seized[actuator]
        return jnp.where(stopped, int(DiagnosedKind.STOPPED), kind)
