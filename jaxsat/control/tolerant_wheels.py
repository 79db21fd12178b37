"""Reaction wheels under the fault-tolerant law: reallocated, down to two."""

import dataclasses
from typing import NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import MOST_RETURNS, WEAK, DiagnosisMemory
from jaxsat.control.diagnosis.residual import Reading, momentum_with_rotors
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.momentum_fit import MomentumFit, MomentumMemory
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.reconfiguration import Left
from jaxsat.control.tolerant_actuators import (
    AbstractTolerantActuators,
    Demand,
    Sample,
    TolerantMemory,
)
from jaxsat.control.two_wheels import TwoWheels
from jaxsat.control.undriven_momentum import nearest_held
from jaxsat.control.what_is_left import LEFT
from jaxsat.control.wheel_allocation import WheelAllocation, Wheeled
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import DCM, Quaternion
from jaxsat.core.checks import not_negative
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach

OfEach = Float[Array, " m"]

UNLOADING = 0.2
"""Times the natural frequency: rate at which momentum without effect on the body is taken out."""

ROOM = 0.5
"""Over the natural frequency: for so long at least a wheel is to make the torque that counts on it
before its momentum comes to the limit."""

FULL, EMPTY = 0.7, 0.2
"""Of the largest momentum of a wheel: above the first thrusters begin to take momentum out, below
the second they end."""

REACTION = 0.5
"""Of the torque of a wheel: what it makes at most against thrusters that take momentum out."""

TURNING, SLOWLY = 2e-3, 0.5
"""Times the natural frequency: with two wheels, the rate that momentum about the axis without a
wheel leaves, above which no attitude is asked for; and below which part of that one is again."""

MOST_MOMENTUM = 1.0
"""Times the largest rate of a slew, or a fifth of the natural frequency if that is less: momentum
as a rate beyond which rates are damped. Coning two wheels turn the body no faster than that."""

KNOWN = 0.5
"""Of that rate: how well momentum is known at rest."""

NEAR = 0.02
"""rad; an attitude nearer than this to the target counts as the target."""

SMALLEST = 1e-30
"""Keeps a quotient of two zeros finite."""


class WheelLawMemory(NamedTuple):
    """The last `command` (N m) of each wheel, and the rate that two wheels would leave.

    `sign` is that of the next test pulse, `fit` what is known of the total momentum. `held` is the
    attitude, relative to the target, that two wheels go to, if they `can` hold one; `near` tells
    whether that is the target.
    """

    command: OfEach
    sign: RealScalar
    fit: MomentumMemory
    held: Quaternion
    near: BoolScalar
    can: BoolScalar


class TolerantWheels(AbstractTolerantActuators):
    """Reaction wheels, whose command is the torque of each on the body, N m.

    Two of them settle all axes by `two_wheels` where no momentum about the third is left; else
    rates are damped, which takes energy out whatever is left. `known` says which had failed before
    the start. Commands act `delay` (s) late.
    """

    filter: WheelFilter
    two_wheels: TwoWheels
    fit: MomentumFit
    known: Bool[Array, " m"]
    delay: RealScalar = eqx.field(converter=not_negative("delay"))

    @property
    def failed_before(self) -> Bool[Array, " m"]:
        """Those that are `known`."""
        return self.known

    @property
    def allocation(self) -> WheelAllocation:
        """How a torque is shared among the wheels that are used."""
        return WheelAllocation(self.filter)

    @property
    def watch(self) -> WheelFilter:
        """The filter of momenta."""
        return self.filter

    def init(
        self, state: PlantState, reading: Reading, diagnosis: DiagnosisMemory
    ) -> TolerantMemory:
        """All wheels work but those that are known to have failed."""
        momentum = cast(OfEach, reading.momentum)
        condition = diagnosis.condition
        condition = condition._replace(
            failed=self.known, part=jnp.where(self.known, 0.0, condition.part)
        )
        diagnosis = diagnosis._replace(
            condition=condition, returns=jnp.where(self.known, MOST_RETURNS, diagnosis.returns)
        )
        zero = jnp.zeros_like(momentum)
        ability = self.allocation.find(condition, momentum)
        true, target = zero[0] == 0, Quaternion(jnp.eye(4)[0])
        own = WheelLawMemory(zero, zero[0] + 1, self.fit.init(), target, true, true)
        return TolerantMemory(diagnosis, ability, zero, zero[0], own)

    def needed(self, memory: TolerantMemory) -> Bool[Array, " m"]:
        """All."""
        return jnp.ones_like(memory.diagnosis.condition.failed)

    def changed(self, memory: TolerantMemory) -> BoolScalar:
        """Whether something has failed, also a wheel that stays in service."""
        return jnp.any((memory.diagnosis.kind >= 0) | self.known)

    def missing(self, memory: TolerantMemory) -> Vector:
        """The normal of two axes."""
        return jnp.where(memory.ability.left == Left.PLANE, memory.ability.normal, 0.0)

    def wheeled(self, memory: TolerantMemory) -> Wheeled:
        """Those in use."""
        return memory.ability

    def stored(self, reading: Reading) -> Vector:
        """The momentum of the wheels with that of rotors which turn with the body, N m s."""
        return self.filter.wheels.axes @ self._momenta(reading)

    def able(
        self, sample: Sample, diagnosis: DiagnosisMemory, before: TolerantMemory
    ) -> TolerantMemory:
        """With what the wheels in use make together, and whether two of them settle."""
        momentum = cast(OfEach, sample.reading.momentum)
        wheeled = self.allocation.find(diagnosis.condition, momentum, before.ability)
        own = self._turning(sample, wheeled, before)
        return before._replace(diagnosis=diagnosis, ability=wheeled, own=own)

    def reach(self, sample: Sample, memory: TolerantMemory) -> Reach:
        """The torque of each (N m), which ends as its momentum comes to the limit."""
        usable, limit = memory.ability.usable, self.filter.wheels.momentum_limit
        low, high = -usable, usable
        if limit is not None:
            momentum = cast(OfEach, sample.reading.momentum)
            rate = sample.law.natural_frequency / ROOM
            low = -jnp.minimum(usable, jnp.maximum(limit - momentum, 0.0) * rate)
            high = jnp.minimum(usable, jnp.maximum(limit + momentum, 0.0) * rate)
        return Reach(self.filter.wheels.axes, low, high, jnp.zeros_like(usable))

    def unloadable(
        self, sample: Sample, memory: TolerantMemory, bias: Vector, field: Vector, held: BoolScalar
    ) -> Vector:
        """What wheels in use hold beyond the bias."""
        momentum = self._momenta(sample.reading)
        alone = self.allocation.unloadable(memory.ability, momentum, bias, field)
        working = jnp.where(memory.ability.working, momentum, 0.0)
        return jnp.where(held, self.filter.wheels.axes @ working - bias, alone)

    def overfull(
        self, sample: Sample, memory: TolerantMemory, unloads: BoolScalar
    ) -> tuple[BoolScalar, Vector]:
        """Whether wheels would hold much once the body rests, and the torque that lessens it."""
        wheeled, limit = memory.ability, self.filter.wheels.momentum_limit
        if limit is None:
            return jnp.zeros_like(unloads), jnp.zeros(3)
        each = wheeled.shares @ self._held(sample, wheeled)
        fullest = jnp.max(jnp.abs(each) / limit)
        unloads = fullest > jnp.where(unloads, EMPTY, FULL)
        most = REACTION * wheeled.usable
        wanted = jnp.clip(UNLOADING * sample.law.natural_frequency * each, -most, most)
        return unloads, jnp.where(unloads, -(self.filter.wheels.axes @ wanted), 0.0)

    def steady(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Nothing: what brakes a wheel is made up for by its own command."""
        return jnp.zeros(3)

    def act(
        self, sample: Sample, demand: Demand, before: TolerantMemory, now: TolerantMemory
    ) -> tuple[OfEach, TolerantMemory]:
        """The torque of each wheel on the body, N m."""
        momentum, wheeled, law = cast(OfEach, sample.reading.momentum), now.ability, sample.law
        by_two, _ = self.alone(now)
        by_two = by_two & ~demand.three
        plane = (wheeled.left == Left.PLANE) & ~demand.three
        torque = jnp.where(plane, self._by_two(sample, wheeled, now.own), demand.torque)
        unloading = UNLOADING * law.natural_frequency
        shared = self.allocation.shared(wheeled, torque)
        if demand.use is not None:
            shared = jnp.where(demand.three, demand.use, shared)
        shared = self.allocation.balanced(wheeled, shared, momentum, unloading)
        shared = jnp.where(demand.three | by_two, shared, self.damping(sample, now))
        if demand.instead is not None:
            shared = jnp.where(demand.instead.when, demand.instead.use, shared)
        pulse, probe = self._pulses(sample, now)
        shared = shared + jnp.where(jnp.abs(shared) < jnp.abs(pulse), pulse, 0.0)
        torques = self.allocation.commands(now.diagnosis.condition, momentum, shared)
        command = jnp.where(wheeled.working, torques, pulse)
        late = self.delay * before.own.command + (law.period - self.delay) * command
        own = now.own._replace(command=command, sign=-now.own.sign)
        return command, now._replace(commanded=late, probe=probe, own=own)

    def slowed(self, sample: Sample, memory: TolerantMemory) -> QuaternionFeedback:
        """The law with the rate at which the momentum of the body fits into the wheels in use."""
        law, wheeled = sample.law, memory.ability
        free = self.allocation.largest_momentum(wheeled, self._held(sample, wheeled))
        if free is None:
            return law
        most = free / jnp.sqrt(jnp.sum(law.model.spacecraft.inertia**2))
        return dataclasses.replace(law, max_rate=jnp.minimum(law.max_rate, most))

    def _momenta(self, reading: Reading) -> OfEach:
        """Of each wheel with its rotor, N m s."""
        return momentum_with_rotors(self.filter.wheels, reading)

    def _held(self, sample: Sample, wheeled: Wheeled) -> Vector:
        """The momentum (N m s) of the body and the wheels in use."""
        working = jnp.where(wheeled.working, self._momenta(sample.reading), 0.0)
        body = sample.law.model.spacecraft.inertia @ sample.state.omega
        return body + self.filter.wheels.axes @ working

    def _by_two(self, sample: Sample, wheeled: Wheeled, own: WheelLawMemory) -> Vector:
        """The torque (N m) of two wheels, with the gyroscopic one."""
        state, law = sample.state, sample.law
        inertia = self.fit.inertia(own.fit)
        momentum = inertia @ state.omega + self.stored(sample.reading)
        torque = self.two_wheels.torque(
            state, wheeled.normal, inertia, law.natural_frequency, law.max_rate, own.held
        )
        return torque + jnp.cross(state.omega, momentum)

    def _turning(self, sample: Sample, wheeled: Wheeled, before: TolerantMemory) -> WheelLawMemory:
        """Where momentum lets two wheels rest.

        With the total momentum H in the target's axes, n·Jω = n·(H - A h) of the wheels not in use.
        """
        state, law, momentum = sample.state, sample.law, self._momenta(sample.reading)
        model, axes, own = law.model, self.filter.wheels.axes, before.own
        normal, inertia = wheeled.normal, model.spacecraft.inertia
        into_body = state.attitude.as_dcm().matrix
        total = into_body.T @ (inertia @ state.omega + axes @ momentum)
        changed = jnp.any(wheeled.working != before.ability.working)
        fit = self.fit.update(own.fit, into_body, state.omega, total, changed)
        unit = model.spacecraft.momentum_unit
        size = unit * jnp.sqrt(jnp.sum((inertia @ normal / unit) ** 2) + SMALLEST)
        known, error = self.fit.known(fit)
        # what the rate of the target needs
        excess = (known - inertia @ model.orbit.frame_rate(DCM(jnp.eye(3)))) / size
        coasting = axes @ jnp.where(wheeled.working, 0.0, momentum) / size
        limit = TURNING * law.natural_frequency
        held = nearest_held(excess, coasting, normal, 2 * error / size + KNOWN * limit)
        most = MOST_MOMENTUM * jnp.minimum(law.max_rate, 0.2 * law.natural_frequency)
        inertial = model.orbit.rate == 0
        fits = held.exists & (jnp.sum(excess**2) < most**2) & inertial
        limit = limit * jnp.where(own.can & ~changed, 1.0, SLOWLY)
        rests = jnp.abs(normal @ (excess - coasting)) < limit
        attitude = jnp.where(fits, held.attitude.q, jnp.eye(4)[0])
        near = ~fits | (held.angle < NEAR)
        return own._replace(fit=fit, held=Quaternion(attitude), near=near, can=rests | fits)

    def damping(self, sample: Sample, memory: TolerantMemory) -> OfEach:
        """Each wheel against the rate about its own axis (N m)."""
        axes, usable, law = self.filter.wheels.axes, memory.ability.usable, sample.law
        inverse = law.model.spacecraft.inverse_inertia
        inertia = 1 / jnp.sum(axes * (inverse @ axes), axis=0)
        pull = 2 * law.damping * law.natural_frequency
        return jnp.clip(-pull * inertia * (axes.T @ sample.state.omega), -usable, usable)

    def alone(self, memory: TolerantMemory) -> tuple[BoolScalar, IntScalar]:
        """By two wheels, where there is an attitude at which they leave no rate."""
        can = (memory.ability.left == Left.PLANE) & memory.own.can
        (target,), (nearest,) = LEFT["two wheels"].modes, LEFT["nearest attitude"].modes
        mode = jnp.where(memory.own.near, int(target), int(nearest))
        return can, mode

    def _pulses(self, sample: Sample, memory: TolerantMemory) -> tuple[OfEach, RealScalar]:
        """Test torques (N m), of either sign in turn, and the time since the last one (s).

        During an alarm they are of the wheels that explain the residuals; otherwise, now and then,
        of those that may work again, and of those that are braked and may not turn any more. Those
        of a wheel that has failed stand out if it makes a `WEAK` part of them.
        """
        diagnosis = memory.diagnosis
        due, probe = self.probing(sample, memory)
        braked = ~diagnosis.condition.failed & (diagnosis.condition.flow > 0)
        now_and_then = diagnosis.may_return | braked
        tested = (now_and_then & due) | (diagnosis.rival & diagnosis.alarmed)
        test = diagnosis.test_command(self.filter, sample.law.period)
        weak = self.filter.test_command(sample.law.period, self.filter.noise / WEAK)
        test = memory.own.sign * jnp.where(diagnosis.condition.failed, weak, test)
        return jnp.where(tested, test, 0.0), probe
