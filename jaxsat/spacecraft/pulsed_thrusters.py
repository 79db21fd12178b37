"""Thrusters that open and shut inside a control period, at their true instants."""

from typing import NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.smooth import at_least, within
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.failures import Condition, FailureEvents
from jaxsat.spacecraft.holds import AbstractPulsedActuators, Consumption, Hold, Usage
from jaxsat.spacecraft.least_propellant import LeastPropellant
from jaxsat.spacecraft.modulation import AbstractModulation, Pulses
from jaxsat.spacecraft.thrusters import ThrusterSet

RealScalar = Float[Array, ""]

ROUNDING = 1e-13
"""Of a period: ramps that end so close together end together, pulses so close to its end there."""


class ThrusterMemory(NamedTuple):
    """The modulator's memory, the pulses of the last period, and what was used since the start.

    `level` is the thrust of each thruster in parts of its full one, None where it takes no time to
    rise and fall; `open` tells which valves were told to be open at the end. `pulses` is None where
    no valve is late.
    """

    modulation: PyTree
    pulses: Pulses | None
    level: Float[Array, " m"] | None
    open: Bool[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class PulsePlan(NamedTuple):
    """Pulses of a period that begins at `t` (s), and those of the last one that go on in it.

    `memory` is that of the next period but for what is used until then.
    """

    t: RealScalar
    period: RealScalar
    pulses: Pulses
    memory: ThrusterMemory


class Running(NamedTuple):
    """Time since the sample (s), and what has been up to then in this period.

    The `level` of each thruster is as in `ThrusterMemory`, `propellant` (kg) what was used,
    `on_time` ∫ level dt (s) and `impulse` ∫ torque dt (N m s).
    """

    now: RealScalar
    level: Float[Array, " m"] | None
    propellant: RealScalar
    on_time: Float[Array, " m"]
    impulse: Float[Array, "3"]


class PulsedThrusters(AbstractPulsedActuators):
    """Allocation, modulation, valves and failures of a set of thrusters that push.

    Without an `allocation` the law commands the duty of each.
    Where valves may be `late`, by a delay of theirs, of the law or of a failure, pulses reach into
    the next period. A delay of more than a period counts as one; thrust must rise and fall within a
    period.
    """

    thrusters: ThrusterSet
    allocation: LeastPropellant | None
    modulation: AbstractModulation
    failures: FailureEvents | None = None
    late: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.thrusters.valve_delay is not None and not self.late:
            raise ValueError("Argument `late` must be true for thrusters with a `valve_delay`.")

    @property
    def holds(self) -> int:
        """One more than there are edges: of commands, failures, and ends of ramps."""
        count = self.thrusters.count
        edges = self.modulation.edges(self.allocation.between if self.allocation else count, count)
        if self.late:
            edges = 2 * (edges + count)
        edges += 0 if self.failures is None else self.failures.count
        if self.thrusters.ramps:
            edges += edges + count
        return edges + 1

    def init(self) -> ThrusterMemory:
        """All valves shut, nothing used."""
        count = self.thrusters.count
        zero, modulation = jnp.zeros(count), self.modulation.init(count)
        pulses = None
        if self.late:
            command = jnp.zeros(self.allocation.command_map.shape[1] if self.allocation else count)
            period = jnp.ones_like(zero[0])
            first = self._pulses(command, modulation, period)[0]
            pulses = Pulses(first.on, 0 * first.off, 0 * first.level)
        level = zero if self.thrusters.ramps else None
        return ThrusterMemory(modulation, pulses, level, zero > 0, zero[0], zero)

    def duties(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Parts of full thrust, on average over a period, for the law's command."""
        if self.allocation is None:
            return within(command, jnp.zeros_like(command), jnp.ones_like(command))
        return self.allocation(command)[0]

    def unmade(self, command: Float[Array, " torques"]) -> Float[Array, "3"] | None:
        """What no duties make, N m; None where the law commands these."""
        return None if self.allocation is None else self.allocation(command)[1]

    def _pulses(self, command, modulation, period) -> tuple[Pulses, PyTree]:
        """Pulses, and the modulator's next memory; a valve that is open to the end stays so."""
        duty = self.duties(command)
        pulses, modulation = self.modulation(duty, modulation, period, self.thrusters.min_on_time)
        to_end = pulses.off >= period * (1 - ROUNDING)
        return pulses._replace(off=jnp.where(to_end, period, pulses.off)), modulation

    def plan(self, t, command, memory, period, delay):
        """Pulses as commanded, shifted by what the valves are late."""
        pulses, modulation = self._pulses(command, memory.modulation, period)
        real = pulses.off > pulses.on
        begins = real & ~((pulses.on <= 0) & memory.open[None])
        counted = 1.0 if self.modulation.counts_openings() else 0.0
        opened = jnp.sum(begins, axis=0, dtype=memory.openings.dtype)
        following = memory._replace(
            modulation=modulation,
            pulses=pulses if self.late else None,
            open=jnp.any(real & (pulses.off >= period), axis=0),
            openings=memory.openings + counted * opened,
        )
        if self.late:
            pulses = self._late(t, pulses, memory.pulses, period, delay)
        elif delay is not None:
            raise ValueError("Argument `late` must be true for a loop with a delay.")
        zero = jnp.zeros_like(memory.openings)
        torque = jnp.zeros(3, zero.dtype)
        running = Running(zero[0], memory.level, zero[0], zero, torque)
        return PulsePlan(t, period, pulses, following), running

    def _late(self, t, pulses, before, period, delay) -> Pulses:
        late = self._condition(t, jnp.zeros_like(period)).delay
        for more in (self.thrusters.valve_delay, delay):
            late = late if more is None else late + more
        late = jnp.minimum(late, period)[None]
        return Pulses(
            jnp.concatenate([before.on + (late - period), pulses.on + late]),
            jnp.concatenate([before.off + (late - period), pulses.off + late]),
            jnp.concatenate([before.level, pulses.level]),
        )

    def _condition(self, t: RealScalar, now: RealScalar) -> Condition:
        if self.failures is None:
            return Condition.sound(self.thrusters.torque)
        return self.failures.condition(t, now, self.thrusters.torque)

    def reach(self, struck: Bool[Array, " f"]) -> Reach:
        """The duty of each, from what leaks to what is left of full thrust."""
        condition = Condition.sound(self.thrusters.torque)
        if self.failures is not None:
            condition = self.failures.at_work(struck, self.thrusters.torque)
        high = jnp.maximum(condition.gain, condition.floor)
        return Reach(condition.torque, condition.floor, high, self.thrusters.flow)

    def under_way(self, plan, running):
        """Whether time is left."""
        return running.now < plan.period

    def advance(self, plan, running):
        """Up to the next edge of a command, of a failure or of a ramp."""
        now, pulses = running.now, plan.pulses
        condition = self._condition(plan.t, now)
        acting = (pulses.on <= now) & (now < pulses.off)
        commanded = jnp.sum(jnp.where(acting, pulses.level, 0.0), axis=0)
        target = at_least(condition.gain * commanded, condition.floor)
        edges = [pulses.on.ravel(), pulses.off.ravel()]
        if self.failures is not None:
            edges.append(self.failures.at - plan.t)
        if not self.thrusters.ramps:
            end = _next(edges, now, plan.period)
            torque = condition.torque @ target
            hold = Hold(now, end - now, torque)
            return hold, self._later(running, end, hold.length, None, target, torque)
        level, slope, arrival = self._ramps(now, cast(Array, running.level), target)
        end = _next([*edges, arrival], now, plan.period)
        length = end - now
        hold = Hold(now, length, condition.torque @ level, condition.torque @ slope)
        arrived = arrival <= end + ROUNDING * plan.period
        after = jnp.where(arrived, target, level + slope * length)
        mean = level + slope * (length / 2)
        torque = hold.torque_after(length / 2)
        return hold, self._later(running, end, length, after, mean, torque)

    def _later(self, running: Running, end, length, level, mean, torque) -> Running:
        """At the end (s) of a hold with these mean levels and this mean torque."""
        return Running(
            end,
            level,
            running.propellant + length * jnp.sum(self.thrusters.flow * mean),
            running.on_time + length * mean,
            running.impulse + length * torque,
        )

    def _ramps(self, now, level, target):
        """Levels now, how they change (1/s), and when they arrive (s)."""
        rise, fall = cast(Array, self.thrusters.rise_time), cast(Array, self.thrusters.fall_time)
        rises = target > level
        times = jnp.where(rises, rise, fall)
        moves = (target != level) & (times > 0)
        slope = jnp.where(rises, 1.0, -1.0) / jnp.where(moves, times, 1.0)
        arrival = now + jnp.abs(target - level) * times
        return jnp.where(moves, level, target), jnp.where(moves, slope, 0.0), arrival

    def finish(self, plan, running):
        """What has been used is summed up."""
        propellant = plan.memory.propellant + running.propellant
        memory = plan.memory._replace(level=running.level, propellant=propellant)
        usage = Usage(
            running.impulse / plan.period,
            running.on_time / plan.period,
            propellant,
            memory.openings,
        )
        return memory, usage

    def consumption(self, memory):
        """As the memory has it."""
        return Consumption(memory.propellant, memory.openings)


def _next(edges, now, period) -> RealScalar:
    """The first edge after now (s), at most the end of the period."""
    ahead = jnp.concatenate(edges)
    return jnp.minimum(jnp.min(jnp.where(ahead > now, ahead, period)), period)
