"""Thrusters under the fault-tolerant law: reallocated, or flown by three slews in a plane."""

from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.control.diagnosis.diagnosis import DiagnosisMemory
from jaxsat.control.diagnosis.residual import Reading
from jaxsat.control.diagnosis.thruster_filter import ThrusterFilter
from jaxsat.control.leaks import LeakMemory, Leaks
from jaxsat.control.least_squares import Fit
from jaxsat.control.pulse_rounding import PulseRounding
from jaxsat.control.reconfiguration import Rank, Reconfiguration
from jaxsat.control.supervisor import Phase, SettlingMemory, ThreeSlewSettling
from jaxsat.control.tolerant_actuators import (
    AbstractTolerantActuators,
    Demand,
    Sample,
    TolerantMemory,
    TolerantMode,
    tolerant_mode,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_float
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach

TEST_PERIODS = 3
"""Control periods between the test pulses of two thrusters during an alarm."""

MOSTLY = 0.5
"""Duty above which a thruster is tested by a gap in its thrust, not by a pulse: one that is stuck
on and one that pushes nearly all the time look alike until a gap."""

QUIET_SIGMAS = 4.0
"""Rate about a thruster's torque, in sigmas of the noise, below which it is not damped."""


class ThrusterLawMemory(NamedTuple):
    """Memory of the laws in a plane, of leaks and of the modulator.

    `spill` (s) is the part of the on-times that reaches into the next period, `owed` (N m s) the
    impulse that rounding to whole pulses has left out so far.
    """

    settling: SettlingMemory | None
    leaking: LeakMemory
    modulation: PyTree
    spill: Float[Array, " m"]
    owed: Vector


class SettlingLaws(eqx.Module):
    """Laws of two torques, one for each plane that failures leave.

    The arrays of `laws` have a leading axis. `of_set` (sets,) is the index of each failed set's
    law, `directions` (laws, 3, 2) are the axes of its two torques.
    """

    laws: ThreeSlewSettling
    of_set: Int[Array, " sets"]
    directions: Float[Array, "laws 3 2"] = eqx.field(converter=as_float)
    leaks: Leaks

    def at(self, number: IntScalar) -> tuple[ThreeSlewSettling, Float[Array, "3 2"], Leaks]:
        """Return the law of a failed set, its directions and its leaks."""
        place = self.of_set[number]
        law, leaks = jax.tree.map(lambda x: x[place], (self.laws, self.leaks))
        return law, self.directions[place], leaks


class TolerantThrusters(AbstractTolerantActuators):
    """Thrusters, whose command is the duty of each.

    Isolated thrusters are left out, and their constant torque is fed forward. Where torques of
    either sign remain in a plane, `settling` flies three slews in the normal form of that plane;
    else thrusters oppose what flows out of failed ones, and besides fire against rates, which takes
    energy out. During an alarm the suspect and its rivals in turn give test pulses, or gaps where
    they push most of the time. Failed thrusters give pulses now and then to detect a recovery.
    Those that had failed before the start are not among them.
    """

    filter: ThrusterFilter
    reconfiguration: Reconfiguration
    rounding: PulseRounding
    settling: SettlingLaws | None

    @property
    def watch(self) -> ThrusterFilter:
        """The residual filter of body rates."""
        return self.filter

    def init(
        self, state: PlantState, reading: Reading, diagnosis: DiagnosisMemory
    ) -> TolerantMemory:
        """Return the memory at the start: all thrusters work."""
        thrusters = self.filter.thrusters
        zero = jnp.zeros(thrusters.count, state.omega.dtype)
        own = ThrusterLawMemory(
            None if self.settling is None else self.settling.at(jnp.array(0))[0].init(state),
            LeakMemory.none(thrusters.count),
            thrusters.modulation.init(thrusters.count),
            zero,
            jnp.zeros(3, state.omega.dtype),
        )
        return TolerantMemory(diagnosis, self.reconfiguration.whole, zero, zero[0], own)

    def needed(self, memory: TolerantMemory) -> Bool[Array, " m"]:
        """Thrusters whose loss leaves less than three axes, or a set without a table."""
        return self.reconfiguration.needed(memory.diagnosis.condition.failed)

    def able(
        self, sample: Sample, diagnosis: DiagnosisMemory, before: TolerantMemory
    ) -> TolerantMemory:
        """Update the ability by the tables of failed sets, weak thrusters and flows."""
        ability = self.reconfiguration.find(diagnosis.condition, before.ability)
        return before._replace(diagnosis=diagnosis, ability=ability)

    def pushed(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return the mean torque (N m) since the last sample by commands and verdicts."""
        condition = memory.diagnosis.condition
        thrust = condition.part * memory.commanded / period + condition.flow
        return self.filter.thrusters.torque @ thrust

    def early(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return Σ b τ (1/2 - c/T), with on-times τ about the instants c of the period T."""
        thrusters, on_time = self.filter.thrusters, memory.commanded
        middle = (thrusters.opening_delay + on_time / 2) / period
        effective = memory.diagnosis.condition.part * on_time
        return thrusters.torque @ (effective * (0.5 - middle))

    def quiet(self, memory: TolerantMemory) -> BoolScalar:
        """Whether no thruster is suspected, or makes a torque all the time."""
        return ~memory.diagnosis.alarmed & ~self.flows(memory)

    def thrust_limit(self, memory: TolerantMemory) -> Float[Array, " m"]:
        """Return the usable thrust of each thruster, over its full thrust."""
        return memory.ability.limit

    def flows(self, memory: TolerantMemory) -> BoolScalar:
        """Whether a thruster is stuck on or leaks."""
        condition = memory.diagnosis.condition
        return jnp.any(condition.failed & (condition.flow > 0))

    def steady(self, memory: TolerantMemory, period: RealScalar) -> Vector:
        """Return the torque (N m) against flows of failed thrusters and external torques."""
        condition = memory.diagnosis.condition
        besides = self.filter.believed(condition, period)
        return -(self.filter.thrusters.torque @ condition.flow + besides)

    def reach(self, sample: Sample, memory: TolerantMemory) -> Reach:
        """Return the range of duties, priced by propellant: the dearest torque has the price 1."""
        high, duties = memory.ability.limit, self.reconfiguration.duties
        price = duties.price * duties.size
        return Reach(self.reconfiguration.torque, jnp.zeros_like(high), high, price)

    def act(
        self, sample: Sample, demand: Demand, before: TolerantMemory, now: TolerantMemory
    ) -> tuple[Float[Array, " m"], TolerantMemory]:
        """Return the duty of each thruster."""
        thrusters, period, three = self.filter.thrusters, sample.law.period, demand.three
        limit, own = now.ability.limit, before.own
        plane = self.alone(now) & ~three
        holds = three | plane
        torque, steady, settling, leaking = self._in_plane(sample.state, demand, plane, before, now)
        owed = jnp.where(three, own.owed, 0.0)
        torque, unmade, besides = torque + owed / period, jnp.zeros(3), None
        if demand.use is not None:  # the torque can be made, and comes before what is owed
            steady = jnp.where(three, demand.torque, steady)
            torque = jnp.where(three, owed / period, torque)
        opposed = jnp.where(self.flows(now), self.steady(now, period), 0.0)
        torque, steady = jnp.where(holds, torque, 0.0), jnp.where(holds, steady, opposed)
        thrust, shortfall = self.reconfiguration.duties(torque, limit, steady)
        if demand.use is not None:
            unmade = jnp.where(three, period * shortfall, 0.0)
            besides = sample.law.model.spacecraft.inverse_inertia @ unmade
        duty = thrust / jnp.where(limit > 0, limit, 1.0)
        whole = self.rounding(limit, duty, period, besides)
        owed = unmade + period * (thrusters.torque @ (limit * (duty - whole)))
        duty = jnp.where(three, whole, duty)
        if self.settling is not None and settling is not None:
            leaks, fit = self.settling.at(now.ability.number)[2], cast(Fit, settling.estimator.fit)
            push = cast(RealScalar, settling.push)
            with_push, leaking = leaks.push(fit, push, duty, limit, period, leaking)
            duty = jnp.where(plane, with_push, duty)
        duty = jnp.where(holds, duty, self.damping(sample, now, duty))
        if demand.instead is not None:
            duty = jnp.where(demand.instead.when, demand.instead.use, duty)
        if demand.besides is not None:
            duty = jnp.minimum(duty + demand.besides, 1.0)
        due, probe = self.probing(sample, now)
        suspected = in_turn(now.diagnosis, period)
        tested = (now.diagnosis.may_return & due) | suspected
        test = now.diagnosis.test_command(self.filter, period)
        pulsed = jnp.where(tested, jnp.maximum(duty, test), duty)
        duty = jnp.where(suspected & (duty > MOSTLY), 0.0, pulsed)
        on_time, spill, modulation = thrusters.on_times(duty, own.modulation, period)
        own = ThrusterLawMemory(settling, leaking, modulation, spill, owed)
        return duty, now._replace(commanded=before.own.spill + on_time, probe=probe, own=own)

    def _in_plane(
        self,
        state: PlantState,
        demand: Demand,
        plane: BoolScalar,
        before: TolerantMemory,
        now: TolerantMemory,
    ) -> tuple[Vector, Vector, SettlingMemory | None, LeakMemory]:
        """Return torque and steady torque (N m) with a plane's law, and the law's memories."""
        settling, leaking = before.own.settling, before.own.leaking
        if self.settling is None or settling is None:
            return demand.torque, demand.steady, settling, leaking
        number, rank, limit = now.ability
        changed = (number != before.ability.number) | (rank != before.ability.rank)
        begins = (rank == Rank.PLANE) & changed
        law, directions, leaks = self.settling.at(number)
        settling = choose(begins, law.init(state), settling)
        leaking = choose(begins, LeakMemory.none(self.filter.count), leaking)
        on_time = now.diagnosis.condition.part * before.commanded
        aid = leaks.aid(leaking, on_time, settling.fine.late)
        free = jnp.zeros_like(settling.phase)
        command, settling = law.in_phase(state, settling, free, aid)
        fit = cast(Fit, settling.estimator.fit)
        leaking = jax.lax.cond(
            (rank == Rank.PLANE) & (fit.samples == 0),
            lambda: leaks.found(fit, limit, leaking),
            lambda: leaking,
        )
        beside = self.reconfiguration.beside_plane(limit, demand.steady, directions)
        torque = jnp.where(plane, directions @ command, demand.torque)
        return torque, jnp.where(plane, beside, demand.steady), settling, leaking

    def damping(
        self, sample: Sample, memory: TolerantMemory, opposing: Float[Array, " m"] | float = 0.0
    ) -> Float[Array, " m"]:
        """Return duties against the rate about each thruster's torque, beside those `opposing` what
        flows out of failed thrusters."""
        torque = self.reconfiguration.torque
        size = jnp.sqrt(jnp.sum(torque**2, axis=0))
        units = torque / size[None]
        law = sample.law
        inverse = law.model.spacecraft.inverse_inertia
        inertia = 1 / jnp.sum(units * (inverse @ units), axis=0)
        rate = -jnp.sum(units * sample.state.omega[:, None], axis=0)
        quiet = QUIET_SIGMAS * self.filter.rate_noise
        above = rate - jnp.clip(rate, -quiet, quiet)
        pull = 2 * law.damping * law.natural_frequency
        duty = jnp.clip(opposing + pull * inertia * above / size, 0.0, 1.0)
        return jnp.where(memory.ability.limit > 0, duty, 0.0)

    def alone(self, memory: TolerantMemory) -> BoolScalar:
        """Whether the law of three slews flies."""
        if self.settling is None:
            return jnp.array(False)
        return memory.ability.rank == Rank.PLANE

    def mode_alone(self, memory: TolerantMemory) -> IntScalar:
        """Return the phase of the law of three slews."""
        settling = memory.own.settling
        if self.settling is None or settling is None:
            return jnp.array(int(TolerantMode.DAMPING))
        return tolerant_mode(self.settling.laws.mode(settling), Phase)


def in_turn(diagnosis: DiagnosisMemory, period: RealScalar) -> Bool[Array, " m"]:
    """Select the actuators to test now during an alarm: the suspect and its rivals in turn."""
    rivals = jnp.arange(diagnosis.rival.shape[0]) != diagnosis.suspect
    rivals = rivals & diagnosis.rival
    place = jnp.cumsum(rivals, dtype=jnp.int32) - 1
    sample = jnp.round(diagnosis.age / period).astype(jnp.int32)
    test = sample // TEST_PERIODS
    count = jnp.maximum(jnp.sum(rivals, dtype=jnp.int32), 1)
    turn = place == (test // 2 - 1) % count
    suspected = ~rivals & diagnosis.rival
    alone = ~jnp.any(rivals)
    tested = jnp.where((test % 2 == 1) | alone, suspected, rivals & turn)
    now = diagnosis.alarmed & (sample % TEST_PERIODS == 0) & (test > 0)
    return now & tested
