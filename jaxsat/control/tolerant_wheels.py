"""Reaction wheels under the fault-tolerant law: reallocated, down to two."""

import dataclasses
from typing import NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import MOST_RETURNS, WEAK, DiagnosisMemory
from jaxsat.control.diagnosis.isolation import NONE
from jaxsat.control.diagnosis.residual import Reading, momentum_with_rotors
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.control.momentum_fit import MomentumFit, MomentumMemory
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.reconfiguration import Rank
from jaxsat.control.tolerant_actuators import (
    AbstractTolerantActuators,
    Demand,
    Sample,
    TolerantMemory,
)
from jaxsat.control.two_wheels import TwoWheels, nearest_held
from jaxsat.control.wheel_allocation import WheelAllocation, WheelsInUse
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import DCM, Quaternion
from jaxsat.core.checks import not_negative
from jaxsat.core.declaration.three_torques import FULL
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.allocation import MomentumPrice
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach

OfEach = Float[Array, " m"]

UNLOADING = 0.2
"""Rate at which momentum without effect on the body is taken out, over the natural frequency."""

ROOM = 0.5
"""Least time for which a wheel can make its allocated torque before its momentum comes to the
limit, over the inverse natural frequency."""

EMPTY = 0.2
"""Momentum over the limit of a wheel below which thrusters stop unloading it."""

REACTION = 0.5
"""Largest torque of a wheel against thrusters that unload it, over its limit."""

TURNING, SLOWLY = 2e-3, 0.5
"""With two wheels, rate that momentum about the undriven axis leaves, over the natural frequency,
above which no attitude is commanded; and the fraction of it below which one is again."""

RELIEVED = 5.0
"""Factor of that rate beside magnetorquers, which take the momentum out while the body cones."""

MOST_MOMENTUM = 1.0
"""Momentum as a rate above which rates are damped, over the largest rate of a slew, or over a fifth
of the natural frequency if that is less. Coning two wheels turn the body no faster."""

KNOWN = 0.5
"""Error of the known momentum at rest, over the rate limit of `TURNING`."""

NEAR = 0.02
"""Angle (rad) to the target within which a held attitude counts as the target."""

DEAR = 50.0
"""Price of torque with which thrusters fill a wheel, per part of its momentum limit that it holds,
over the price of the dearest thruster."""


class WheelLawMemory(NamedTuple):
    """Memory of wheels: the last `command` (N m), and the attitude that two wheels hold.

    `sign` is that of the next test pulse, `fit` the estimate of the total momentum. `held` is the
    attitude, relative to the target, that two wheels go to, if they `can` hold one, and `near`
    whether it is the target.
    """

    command: OfEach
    sign: RealScalar
    fit: MomentumMemory
    held: Quaternion
    near: BoolScalar
    can: BoolScalar


class TolerantWheels(AbstractTolerantActuators):
    """Reaction wheels, whose command is the torque of each on the body, N m.

    Two wheels settle all axes by `two_wheels` where no momentum about the third is left; else rates
    are damped, which takes energy out in any case. `failed_at_start` says which had failed before
    the start. Commands act `delay` (s) late. `uneven`: momentum limits are not in proportion to
    torque limits.
    """

    filter: WheelFilter
    two_wheels: TwoWheels
    fit: MomentumFit
    failed_at_start: Bool[Array, " m"]
    delay: RealScalar = eqx.field(converter=not_negative("delay"))
    uneven: bool = eqx.field(static=True, default=False)

    @property
    def failed_before(self) -> Bool[Array, " m"]:
        """Wheels that had failed before the start, as the law knows."""
        return self.failed_at_start

    @property
    def allocation(self) -> WheelAllocation:
        """The allocation of a torque to the wheels in use."""
        return WheelAllocation(self.filter, self.uneven)

    @property
    def watch(self) -> WheelFilter:
        """The residual filter of wheel momenta."""
        return self.filter

    def init(
        self, state: PlantState, reading: Reading, diagnosis: DiagnosisMemory
    ) -> TolerantMemory:
        """Return the memory at the start: all wheels work but those known to have failed."""
        momentum = cast(OfEach, reading.momentum)
        condition = diagnosis.condition
        condition = condition._replace(
            failed=self.failed_at_start, part=jnp.where(self.failed_at_start, 0.0, condition.part)
        )
        diagnosis = diagnosis._replace(
            condition=condition,
            returns=jnp.where(self.failed_at_start, MOST_RETURNS, diagnosis.returns),
        )
        zero = jnp.zeros_like(momentum)
        ability = self.allocation.find(condition, momentum)
        true, target = zero[0] == 0, Quaternion(jnp.eye(4)[0])
        own = WheelLawMemory(zero, zero[0] + 1, self.fit.init(), target, true, true)
        return TolerantMemory(diagnosis, ability, zero, zero[0], own)

    def needed(self, memory: TolerantMemory) -> Bool[Array, " m"]:
        """All wheels: a weak one is never given up as dead."""
        return jnp.ones_like(memory.diagnosis.condition.failed)

    def changed(self, memory: TolerantMemory) -> BoolScalar:
        """Whether a wheel has failed, even if it stays in service."""
        return jnp.any((memory.diagnosis.kind != NONE) | self.failed_at_start)

    def missing(self, memory: TolerantMemory) -> Vector:
        """Return the normal of the two driven axes, or zero."""
        return jnp.where(memory.ability.rank == Rank.PLANE, memory.ability.normal, 0.0)

    def in_use(self, memory: TolerantMemory) -> WheelsInUse:
        """Return the wheels in use."""
        return memory.ability

    def stored(self, reading: Reading) -> Vector:
        """Return the momentum (N m s) of the wheels, with that of rotors turning with the body."""
        return self.filter.wheels.axes @ self._momenta(reading)

    def able(
        self, sample: Sample, diagnosis: DiagnosisMemory, before: TolerantMemory
    ) -> TolerantMemory:
        """Update what the wheels in use make together, and whether two of them settle."""
        momentum = cast(OfEach, sample.reading.momentum)
        in_use = self.allocation.find(diagnosis.condition, momentum, before.ability)
        own = self._turning(sample, in_use, before)
        return before._replace(diagnosis=diagnosis, ability=in_use, own=own)

    def reach(self, sample: Sample, memory: TolerantMemory) -> Reach:
        """Return the range of torques (N m), which closes as momentum nears the limit."""
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
        """Return the momentum (N m s) of wheels in use beyond the bias."""
        momentum = self._momenta(sample.reading)
        alone = self.allocation.unloadable(memory.ability, momentum, bias, field)
        working = jnp.where(memory.ability.working, momentum, 0.0)
        return jnp.where(held, self.filter.wheels.axes @ working - bias, alone)

    def overfull(
        self, sample: Sample, memory: TolerantMemory, unloads: BoolScalar
    ) -> tuple[BoolScalar, Vector]:
        """Whether wheels are too full with the body at rest, and the torque (N m) against it."""
        in_use, limit = memory.ability, self.filter.wheels.momentum_limit
        if limit is None:
            return jnp.zeros_like(unloads), jnp.zeros(3)
        each = self.allocation.holding(in_use) @ self._held(sample, in_use)
        fullest = jnp.max(jnp.abs(each) / limit)
        unloads = fullest > jnp.where(unloads, EMPTY, FULL)
        most = REACTION * in_use.usable
        unloading = jnp.clip(UNLOADING * sample.law.natural_frequency * each, -most, most)
        return unloads, jnp.where(unloads, -(self.filter.wheels.axes @ unloading), 0.0)

    def momentum_price(self, sample: Sample, memory: TolerantMemory) -> MomentumPrice:
        """Return the price of momentum, zero where a wheel can be spared.

        It is in proportion to the momentum of each wheel with the body at rest, and has the sign of
        torques of the wheel that add to this momentum.
        """
        in_use, limit = memory.ability, self.filter.wheels.momentum_limit
        if limit is None:
            return super().momentum_price(sample, memory)
        each = self.allocation.holding(in_use) @ self._held(sample, in_use)
        scarce = jnp.sum(in_use.working) + in_use.rank <= 3
        return MomentumPrice(in_use.shares, jnp.where(scarce, -DEAR * each / limit, 0.0))

    def steady(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return zero: each wheel's own command compensates its friction."""
        return jnp.zeros(3)

    def act(
        self, sample: Sample, demand: Demand, before: TolerantMemory, now: TolerantMemory
    ) -> tuple[OfEach, TolerantMemory]:
        """Return the torque of each wheel on the body, N m."""
        momentum, in_use, law = cast(OfEach, sample.reading.momentum), now.ability, sample.law
        by_two = self.alone(now) & ~demand.three
        plane = (in_use.rank == Rank.PLANE) & ~demand.three
        torque = jnp.where(plane, self._by_two(sample, in_use, now.own), demand.torque)
        unloading = UNLOADING * law.natural_frequency
        uses = self.allocation.shared(in_use, torque)
        if demand.use is not None:
            uses = jnp.where(demand.three, demand.use, uses)
        uses = self.allocation.balanced(in_use, uses, momentum, unloading)
        uses = jnp.where(demand.three | by_two, uses, self.damping(sample, now))
        if demand.instead is not None:
            uses = jnp.where(demand.instead.when, demand.instead.use, uses)
        pulse, probe = self._pulses(sample, now)
        uses = uses + jnp.where(jnp.abs(uses) < jnp.abs(pulse), pulse, 0.0)
        torques = self.allocation.commands(now.diagnosis.condition, momentum, uses)
        command = jnp.where(in_use.working, torques, pulse)
        late = self.delay * before.own.command + (law.period - self.delay) * command
        own = now.own._replace(command=command, sign=-now.own.sign)
        return command, now._replace(commanded=late, probe=probe, own=own)

    def slowed(self, sample: Sample, memory: TolerantMemory) -> QuaternionFeedback:
        """Return the law with slews whose momentum fits into the wheels in use."""
        law, in_use = sample.law, memory.ability
        free = self.allocation.largest_momentum(in_use, self._held(sample, in_use))
        if free is None:
            return law
        most = free / jnp.sqrt(jnp.sum(law.model.spacecraft.inertia**2))
        return dataclasses.replace(law, max_rate=jnp.minimum(law.max_rate, most))

    def _momenta(self, reading: Reading) -> OfEach:
        return momentum_with_rotors(self.filter.wheels, reading)

    def _held(self, sample: Sample, in_use: WheelsInUse) -> Vector:
        """Return the momentum (N m s) of the body and the wheels in use."""
        working = jnp.where(in_use.working, self._momenta(sample.reading), 0.0)
        body = sample.law.model.spacecraft.inertia @ sample.state.omega
        return body + self.filter.wheels.axes @ working

    def _by_two(self, sample: Sample, in_use: WheelsInUse, own: WheelLawMemory) -> Vector:
        """Return the torque (N m) of two wheels, with the gyroscopic one."""
        state, law = sample.state, sample.law
        inertia = self.fit.inertia(own.fit)
        momentum = inertia @ state.omega + self.stored(sample.reading)
        torque = self.two_wheels.torque(
            state, in_use.normal, inertia, law.natural_frequency, law.max_rate, own.held
        )
        besides = 0.0 if sample.reading.unwatched is None else sample.reading.unwatched
        return torque + jnp.cross(state.omega, momentum) - besides

    def _turning(
        self, sample: Sample, in_use: WheelsInUse, before: TolerantMemory
    ) -> WheelLawMemory:
        """Update the attitude at which momentum lets two wheels rest.

        With the total momentum H in the target's axes, n·Jω = n·(H - A h) of the wheels not in use.
        """
        state, law, momentum = sample.state, sample.law, self._momenta(sample.reading)
        model, axes, own = law.model, self.filter.wheels.axes, before.own
        normal, inertia = in_use.normal, model.spacecraft.inertia
        into_body = state.attitude.as_dcm().matrix
        total = into_body.T @ (inertia @ state.omega + axes @ momentum)
        changed = jnp.any(in_use.working != before.ability.working)
        fit = self.fit.update(own.fit, into_body, state.omega, total, changed)
        unit = model.spacecraft.momentum_unit
        size = unit * jnp.sqrt(jnp.sum((inertia @ normal / unit) ** 2) + SMALLEST)
        momentum_at_rest, error = self.fit.known(fit)
        # what the rate of the target needs
        excess = (momentum_at_rest - inertia @ model.orbit.frame_rate(DCM(jnp.eye(3)))) / size
        coasting = axes @ jnp.where(in_use.working, 0.0, momentum) / size
        limit = TURNING * law.natural_frequency
        nearest = nearest_held(excess, coasting, normal, 2 * error / size + KNOWN * limit)
        most = MOST_MOMENTUM * jnp.minimum(law.max_rate, 0.2 * law.natural_frequency)
        inertial = model.orbit.rate == 0
        fits = nearest.exists & (jnp.sum(excess**2) < most**2) & inertial
        limit = limit * jnp.where(own.can & ~changed, 1.0, SLOWLY)
        limit = limit * (1.0 if sample.reading.unwatched is None else RELIEVED)
        rests = jnp.abs(normal @ (excess - coasting)) < limit
        attitude = jnp.where(fits, nearest.attitude.q, jnp.eye(4)[0])
        near = ~fits | (nearest.angle < NEAR)
        return own._replace(fit=fit, held=Quaternion(attitude), near=near, can=rests | fits)

    def damping(self, sample: Sample, memory: TolerantMemory) -> OfEach:
        """Return damping torques (N m), each against the rate about its wheel's axis."""
        axes, usable, law = self.filter.wheels.axes, memory.ability.usable, sample.law
        inverse = law.model.spacecraft.inverse_inertia
        inertia = 1 / jnp.sum(axes * (inverse @ axes), axis=0)
        pull = 2 * law.damping * law.natural_frequency
        return jnp.clip(-pull * inertia * (axes.T @ sample.state.omega), -usable, usable)

    def alone(self, memory: TolerantMemory) -> BoolScalar:
        """Whether two wheels settle: there is an attitude at which they leave no rate."""
        return (memory.ability.rank == Rank.PLANE) & memory.own.can

    def mode_alone(self, memory: TolerantMemory) -> IntScalar:
        """Return the mode of two wheels: at the target, or at the attitude nearest to it."""
        (target,), (nearest,) = FLYABLE["two wheels"].modes, FLYABLE["nearest attitude"].modes
        return jnp.where(memory.own.near, int(target), int(nearest))

    def _pulses(self, sample: Sample, memory: TolerantMemory) -> tuple[OfEach, RealScalar]:
        """Return test torques (N m) of alternating sign, and the time since the last one (s).

        During an alarm the suspected wheels are tested; otherwise, now and then, those that may
        work again, and braked ones that may have stopped. Pulses of a failed wheel stand out if it
        makes a `WEAK` part of them.
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
