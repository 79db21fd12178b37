"""Momenta of wheels that were not commanded: innovations of one filter for each wheel.

A tachometer gives a wheel's momentum h relative to the body. The motor is commanded the torque c on
the body, friction f brakes the rotor, so that dh/dt = -(c + f) - J_w a·dω/dt with the inertia J_w
of a rotor about its axis a. The last term is known from the rates, so each wheel alone shows its
failures, whatever the body does.

In the plane of (a, b) of `jaxsat.control.diagnosis.isolation` b of a wheel is the fraction of its
full motor torque that brakes the rotor all the time, so that a motor that drives it on has b = -1:

    dead (1, 0), degraded (s, 0), friction up (0, s), runaway (1, -1).
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.isolation import (
    LEAST_PART,
    DiagnosedKind,
    Hypotheses,
    Residual,
    most_likely,
    stacked_parts,
)
from jaxsat.control.diagnosis.residual import (
    TEST_SIGMAS,
    TRACKING,
    AbstractResidualFilter,
    ActuatorCondition,
    FilterMemory,
    Prediction,
    Reading,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.checks import positive
from jaxsat.spacecraft.wheel_friction import STILL
from jaxsat.spacecraft.wheels import Wheels

OfEach = Float[Array, " m"]

JUMP = 3.0
"""Momentum change that no motor makes, over that of full torque in a period."""

NEAR_LIMIT = 0.98
"""Momentum over its limit, above which a motor may make less than it is commanded."""


MOST_FRICTION = 4.0
"""Largest friction of a wheel, over the full torque of its motor."""

ROUGH = 0.1
"""Relative error of the torque of a weak motor at a verdict."""


def _parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """Return the most likely (a, b) of every kind; b of a runaway is its real torque, negative."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    loss, braked = most_likely(y, aa), most_likely(z, bb, MOST_FRICTION)
    certain = 1 / uncertainty**2
    driven = (z - ab - certain) / (bb + certain)
    return stacked_parts((one, zero), (loss, zero), (zero, braked), (one, driven))


class Rotors(NamedTuple):
    """Wheels that stopped at once and have not turned since, `seized`, and momentum of rotors.

    `taken` (N m s) is the momentum J_w a·ω of rotors with the body, None without rotor inertia.
    """

    seized: Bool[Array, " m"]
    taken: OfEach | None = None


class WheelFilter(AbstractResidualFilter):
    """A Kalman filter of each wheel's momentum.

    `wheels` are the law's model, with a torque limit each. `momentum_noise` (N m s) is the standard
    deviation of each tachometer. Friction of unknown sign, near rest, is in doubt as a whole.
    Commands are impulses (N m s) on the body. Its `own` memory are `Rotors`.
    """

    hypotheses: ClassVar[Hypotheses] = Hypotheses(
        kinds=(
            DiagnosedKind.DEAD,
            DiagnosedKind.DEGRADED,
            DiagnosedKind.FRICTION_UP,
            DiagnosedKind.RUNAWAY,
        ),
        free=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP, DiagnosedKind.RUNAWAY),
        full=DiagnosedKind.RUNAWAY,
        level=-1.0,
        parts=_parts,
        tests=(1.0, -1.0),
        weak_losses=False,
        in_service=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP),
    )
    restarts_at_losses: ClassVar[bool] = True

    wheels: Wheels
    momentum_noise: OfEach = eqx.field(converter=positive("momentum_noise"))

    def __check_init__(self):
        if self.wheels.torque_limit is None:
            raise ValueError("Argument `wheels` must have a torque limit each.")

    @property
    def count(self) -> int:
        """Number of wheels."""
        return self.wheels.count

    @property
    def noise(self) -> OfEach:
        """Standard deviation of each wheel's measured momentum, N m s."""
        return self.momentum_noise

    @property
    def full(self) -> OfEach:
        """Full torque of each motor, N m."""
        limit = self.wheels.torque_limit
        assert limit is not None
        return limit

    def read(self, reading: Reading) -> Float[Array, "1 m"]:
        """Return the momenta relative to the body, N m s."""
        return _momentum(reading)[None]

    def init(self, reading: Reading) -> FilterMemory:
        """Return the memory at the first reading of the tachometers."""
        momentum = self.read(reading)
        none, no = jnp.zeros_like(momentum), jnp.array(False)
        own = Rotors(none[0] > 0, self._taken(reading))
        errors = jnp.zeros((3, 1, self.count), momentum.dtype)
        return FilterMemory(momentum, self.momentum_noise**2, none, none, errors, None, no, own)

    def _taken(self, reading: Reading) -> OfEach | None:
        """Return the momentum of rotors turning with the body, N m s."""
        wheels = self.wheels
        if wheels.rotor_inertia is None:
            return None
        return wheels.rotor_inertia * (wheels.axes.T @ reading.rate)

    def friction(self, momentum: OfEach, condition: ActuatorCondition) -> OfEach:
        """Return the friction torque of each wheel while it turns at these momenta, N m.

        It has `ActuatorCondition.flow`, a fraction of the motor's full torque, less than zero where
        that drives the wheel on.
        """
        wheels = self.wheels
        torque = condition.flow * self.full
        if wheels.coulomb_friction is not None:
            torque = torque + wheels.coulomb_friction
        if wheels.viscous_friction is not None:
            torque = torque + wheels.decay * jnp.abs(momentum)
        return torque

    def side(self, momentum: OfEach) -> OfEach:
        """Return the direction in which each wheel turns, from -1 to 1: a fraction near rest."""
        return jnp.clip(momentum / (STILL * self.momentum_noise), -1.0, 1.0)

    def predicted(
        self,
        reading: Reading,
        commanded: OfEach,
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
    ) -> Prediction:
        """Predict the effect of motors, friction and the turning body on each momentum."""
        rotor_momentum, before = self._taken(reading), memory.estimate[0]
        left_behind = 0.0
        if rotor_momentum is not None and memory.own.taken is not None:
            left_behind = rotor_momentum - memory.own.taken
        motor = condition.part * commanded
        friction, limit = period * self.friction(before, condition), self.wheels.momentum_limit
        noise = STILL * self.momentum_noise
        after, side = moved(before, motor + left_behind, friction)
        missing, _ = moved(before, left_behind + jnp.zeros_like(motor), friction)
        returned, _ = moved(before, commanded + left_behind, friction)
        missing = jnp.where(condition.failed, returned, missing) - after
        braked, full = before - motor - left_behind - after, period * self.full
        moves = jnp.minimum(jnp.maximum(jnp.abs(before), jnp.abs(after)) / noise, 1.0)
        side = side * moves
        believed = jnp.where(condition.failed, 0.0, missing)  # one that has failed makes nothing
        torques = jnp.stack([believed, left_behind + jnp.zeros_like(believed), braked])
        rests = jnp.abs(before) < jnp.abs(motor) + jnp.abs(friction) + noise
        doubt = jnp.where(rests, friction**2, 0.0)
        if limit is not None:
            near = jnp.abs(before) > NEAR_LIMIT * limit - jnp.abs(motor)
            doubt = doubt + jnp.where(near, motor**2, 0.0)
            after = jnp.clip(after, -limit, limit)
        change = after - before
        driven = (1 - jnp.abs(self.side(before))) * motor / (jnp.abs(motor) + self.momentum_noise)
        still = jnp.abs(_momentum(reading)) < STILL * self.momentum_noise

        def rotors(residual: Residual, left: OfEach) -> Rotors:
            jump = JUMP * full + STILL * jnp.sqrt(residual.variance)
            jumped = jnp.abs(residual.innovation[0]) > jump
            return Rotors(still & (jumped | memory.own.seized), rotor_momentum)

        return Prediction(
            change[None],
            jnp.sum(torques**2, axis=0),
            torques[:, None],
            missing[None],
            -(full * side)[None],
            rotors,
            doubt=doubt,
            driven=driven,
        )

    def tracked(
        self,
        residual: Residual,
        condition: ActuatorCondition,
        period: RealScalar,
        quiet: BoolScalar,
    ) -> ActuatorCondition:
        """Correct the friction of braked wheels, and while it is `quiet` the torque of weak motors.

        A turning wheel shows its friction by how fast it slows; one that is driven and does not
        turn has more. The verdict on a weak motor is rough, and no test shows more torque.
        """
        full, flow, loss = period * self.full, residual.flow[0], residual.loss[0]
        driven = 0.0 if residual.driven is None else residual.driven
        signature = jnp.where(jnp.abs(flow) > full, flow, full * driven)
        wrong = TRACKING * residual.innovation[0]
        braked = ~condition.failed & (condition.flow > 0)
        friction = condition.flow + wrong * signature / (signature**2 + full**2)
        friction = jnp.clip(friction, LEAST_PART, MOST_FRICTION)
        weak = ~condition.failed & (condition.part < 1) & quiet
        less = wrong * loss / (loss**2 + residual.variance / ROUGH**2)
        estimate = condition.part * (1 - less)
        return condition._replace(
            part=jnp.where(weak, jnp.clip(estimate, LEAST_PART, 1 - LEAST_PART), condition.part),
            flow=jnp.where(braked, friction, condition.flow),
        )

    def test_command(self, period: RealScalar, sigma: OfEach) -> OfEach:
        """Return torques (N m) that stand out of errors of a momentum (N m s) within a period."""
        return jnp.minimum(TEST_SIGMAS * sigma / period, self.full)

    def named(self, kind: IntScalar, actuator: IntScalar, memory: FilterMemory) -> IntScalar:
        """Return the kind of a verdict: a dead wheel that stood still at once has stopped."""
        stopped = (kind == DiagnosedKind.DEAD) & memory.own.seized[actuator]
        return jnp.where(stopped, int(DiagnosedKind.STOPPED), kind)


def moved(before: OfEach, motor: OfEach, friction: OfEach) -> tuple[OfEach, OfEach]:
    """Return momentum (N m s) after a period, and mean direction of rotation, -1 to 1.

    A motor takes `motor` out and friction up to `friction` (both N m s), past rest if strong
    enough. Exact for constant torques: no error of `before` grows.
    """
    way, size = jnp.sign(before), jnp.abs(before)
    toward = way * motor + friction
    stops = jnp.maximum(toward, 0.0) >= size
    part = jnp.where(stops, size / jnp.where(stops & (toward > 0), toward, 1.0), 1.0)
    onward = -jnp.sign(motor) * jnp.maximum(jnp.abs(motor) - friction, 0.0)
    after = jnp.where(stops, (1 - part) * onward, before - way * toward)
    return after, part * way + (1 - part) * jnp.sign(onward)


def _momentum(reading: Reading) -> OfEach:
    if reading.momentum is None:
        raise ValueError("Argument `reading` must have the momenta of wheels, but has none.")
    return reading.momentum
