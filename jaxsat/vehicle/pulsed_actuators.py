"""Thrusters that open and shut inside a control period, at their true instants."""

import abc
from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.vehicle.allocation import LeastPropellant
from jaxsat.vehicle.failures import Condition, FailureEvents
from jaxsat.vehicle.modulation import AbstractModulation, Pulses
from jaxsat.vehicle.thruster_set import ThrusterSet
from jaxsat.vehicle.wheels import WheelPiece

RealScalar = Float[Array, ""]

ROUNDING = 1e-13
"""Of a period: ramps that end so close together end together."""


class Hold(NamedTuple):
    """A time in a period during which the torque on the body changes evenly, or not at all.

    `begin` and `length` are in s, `begin` from the sample on. The torque (N m) is `torque` at the
    begin and changes by `torque_rate` (N m/s); None is a torque that stays. `wheels` is the piece
    that wheels are in, None without wheels.
    """

    begin: RealScalar
    length: RealScalar
    torque: Float[Array, "3"]
    torque_rate: Float[Array, "3"] | None = None
    wheels: WheelPiece | None = None

    def wheel_torque(self, momentum: Float[Array, " wheels"] | None):
        """What each wheel does to the body along its axis, N m; None without wheels."""
        return None if self.wheels is None or momentum is None else self.wheels.torque(momentum)

    def part(self, elapsed: RealScalar, length: RealScalar) -> "Hold":
        """The part that begins `elapsed` seconds after the begin, of this length (s)."""
        return self._replace(
            begin=self.begin + elapsed, length=length, torque=self.torque_after(elapsed)
        )

    def divided(self, instant: RealScalar) -> "tuple[Hold, Hold]":
        """The parts before and after an instant (s from the sample on)."""
        first = jnp.clip(instant - self.begin, 0.0, self.length)
        return self.part(0 * first, first), self.part(first, self.length - first)

    def torque_after(self, elapsed: RealScalar) -> Float[Array, "3"]:
        """The torque (N m) `elapsed` seconds after the begin."""
        if self.torque_rate is None:
            return self.torque
        return self.torque + elapsed * self.torque_rate

    def mean_size(self) -> Float[Array, "3"]:
        """The mean of the torque's size about each axis (N m), whichever way it points."""
        first = jnp.abs(self.torque)
        if self.torque_rate is None:
            return first
        end = self.torque + self.length * self.torque_rate
        last = jnp.abs(end)
        both = first + last
        crossing = (first**2 + last**2) / jnp.where(both > 0, 2 * both, 1.0)
        return jnp.where(self.torque * end < 0, crossing, both / 2)


class Usage(NamedTuple):
    """What actuators did in a period.

    `torque` is the mean torque (N m), `level` the mean thrust of each thruster in parts of its full
    one. Since the start of the run `propellant` (kg) was used, and each valve opened `openings`
    times.
    """

    torque: Float[Array, "3"]
    level: Float[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class AbstractPulsedActuators(eqx.Module):
    """Actuators that run once a period and whose torque then changes at instants of their own.

    `plan` makes a plan of the command; `advance` goes through it hold by hold, `holds` times;
    `finish` gives the memory for the next period.
    """

    @property
    @abc.abstractmethod
    def holds(self) -> int:
        """In how many holds a period is divided at most."""

    @abc.abstractmethod
    def init(self) -> PyTree:
        """The memory at the start."""

    @abc.abstractmethod
    def plan(
        self,
        t: RealScalar,
        command: Float[Array, " torques"],
        memory: PyTree,
        period: RealScalar,
        delay: RealScalar | None,
    ) -> tuple[PyTree, PyTree]:
        """The plan of the period that begins at time `t` (s), and what runs through it.

        The law's command (N m) is ready `delay` s after the begin; None is at once.
        """

    @abc.abstractmethod
    def under_way(self, plan: PyTree, running: PyTree) -> Bool[Array, ""]:
        """Whether the period has not ended yet, so that there is a next hold."""

    @abc.abstractmethod
    def advance(self, plan: PyTree, running: PyTree) -> tuple[Hold, PyTree]:
        """The next hold, which has no length where the period has ended."""

    def wheel_command(self, command: Float[Array, " torques"]) -> Float[Array, " wheels"] | None:
        """The torque that each wheel is to put on the body, N m; here None: there are no wheels."""
        del command

    @abc.abstractmethod
    def finish(self, plan: PyTree, running: PyTree) -> tuple[PyTree, Usage]:
        """The memory at the end of the period, and what was used in it."""

    def usage(self, plan: PyTree, running: PyTree) -> Usage:
        """What the whole period will use."""
        (last,) = self.hold_by_hold(plan, running, lambda now: (self.advance(plan, now)[1],))
        return self.finish(plan, last)[1]

    def hold_by_hold(
        self, plan: PyTree, running: PyTree, step: Callable[..., tuple], *carry: PyTree
    ) -> tuple:
        """`step` for each hold of a period, of what runs through the plan and the carry.

        A period seldom has as many holds as it may have. Those left are skipped where an engine
        can, and the loop can be differentiated either way.
        """

        def one(_, now):
            ahead = self.under_way(plan, now[0])
            return jax.lax.cond(ahead, lambda now: step(*now), lambda now: now, now)

        return jax.lax.fori_loop(0, self.holds, one, (running, *carry))


class ThrusterMemory(NamedTuple):
    """The modulator's memory, the pulses of the last period, and what was used since the start.

    `level` is the thrust of each thruster in parts of its full one, `open` tells which valves were
    told to be open at the end. `pulses` is None where no valve is late.
    """

    modulation: PyTree
    pulses: Pulses | None
    level: Float[Array, " m"]
    open: Bool[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class Plan(NamedTuple):
    """Pulses of a period that begins at `t` (s), and those of the last one that go on in it.

    `memory` is that of the next period but for what is used until then.
    """

    t: RealScalar
    period: RealScalar
    pulses: Pulses
    memory: ThrusterMemory


class Running(NamedTuple):
    """Time since the sample (s), the level of each thruster, and ∫ level dt (s) in this period.

    `impulse` is ∫ torque dt (N m s).
    """

    now: RealScalar
    level: Float[Array, " m"]
    on_time: Float[Array, " m"]
    impulse: Float[Array, "3"]


class PulsedThrusters(AbstractPulsedActuators):
    """Allocation, modulation, valves and failures of a set of thrusters that push.

    Where valves may be `late`, by a delay of theirs, of the law or of a failure, pulses reach into
    the next period. A delay of more than a period counts as one; thrust must rise and fall within a
    period.
    """

    thrusters: ThrusterSet
    allocation: LeastPropellant
    modulation: AbstractModulation
    failures: FailureEvents | None = None
    late: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.thrusters.valve_delay is not None and not self.late:
            raise ValueError("Argument `late` must be true for thrusters with a `valve_delay`.")

    @property
    def holds(self) -> int:
        """One more than there are edges: of commands, failures, and ends of ramps."""
        count, firing = self.thrusters.count, self.allocation.firing
        edges = self.modulation.edges(firing, count)
        firing = self.modulation.firing(firing, count)
        if self.late:
            edges = 2 * (edges + firing)
        edges += 0 if self.failures is None else self.failures.count
        if self.thrusters.ramps:
            edges += edges + (count if self.late else min(count, 2 * firing))
        return edges + 1

    def init(self) -> ThrusterMemory:
        """All valves shut, nothing used."""
        count = self.thrusters.count
        zero, modulation = jnp.zeros(count), self.modulation.init(count)
        pulses = None
        if self.late:
            command = jnp.zeros(self.allocation.duties.shape[2])
            period = jnp.ones_like(zero[0])
            first = self._pulses(command, modulation, period)[0]
            pulses = Pulses(first.on, 0 * first.off, 0 * first.level)
        return ThrusterMemory(modulation, pulses, zero, zero > 0, zero[0], zero)

    def _pulses(self, command, modulation, period) -> tuple[Pulses, PyTree]:
        duty = self.allocation(command)
        return self.modulation(duty, modulation, period, self.thrusters.min_on_time)

    def plan(self, t, command, memory, period, delay):
        """Pulses as commanded, shifted by what the valves are late."""
        pulses, modulation = self._pulses(command, memory.modulation, period)
        real = pulses.off > pulses.on
        begins = real & ~((pulses.on <= 0) & memory.open[None])
        counted = 1.0 if self.modulation.counts_openings() else 0.0
        following = memory._replace(
            modulation=modulation,
            pulses=pulses if self.late else None,
            open=jnp.any(real & (pulses.off >= period), axis=0),
            openings=memory.openings + counted * jnp.sum(begins, axis=0),
        )
        if self.late:
            pulses = self._late(t, pulses, memory.pulses, period, delay)
        elif delay is not None:
            raise ValueError("Argument `late` must be true for a loop with a delay.")
        zero = jnp.zeros_like(memory.level)
        running = Running(zero[0], memory.level, zero, jnp.zeros(3, zero.dtype))
        return Plan(t, period, pulses, following), running

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

    def under_way(self, plan, running):
        """Whether time is left."""
        return running.now < plan.period

    def advance(self, plan, running):
        """Up to the next edge of a command, of a failure or of a ramp."""
        now, pulses = running.now, plan.pulses
        condition = self._condition(plan.t, now)
        acting = (pulses.on <= now) & (now < pulses.off)
        commanded = jnp.sum(jnp.where(acting, pulses.level, 0.0), axis=0)
        target = jnp.maximum(condition.gain * commanded, condition.floor)
        edges = [pulses.on.ravel(), pulses.off.ravel()]
        if self.failures is not None:
            edges.append(self.failures.at - plan.t)
        if not self.thrusters.ramps:
            end = _next(edges, now, plan.period)
            torque = condition.torque @ target
            hold = Hold(now, end - now, torque)
            return hold, _later(running, end, hold.length, target, target, torque)
        level, slope, arrival = self._ramps(now, running.level, target)
        end = _next([*edges, arrival], now, plan.period)
        length = end - now
        hold = Hold(now, length, condition.torque @ level, condition.torque @ slope)
        arrived = arrival <= end + ROUNDING * plan.period
        after = jnp.where(arrived, target, level + slope * length)
        mean = level + slope * (length / 2)
        return hold, _later(running, end, length, after, mean, hold.torque_after(length / 2))

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
        propellant = plan.memory.propellant + jnp.sum(self.thrusters.flow * running.on_time)
        memory = plan.memory._replace(level=running.level, propellant=propellant)
        usage = Usage(
            running.impulse / plan.period,
            running.on_time / plan.period,
            propellant,
            memory.openings,
        )
        return memory, usage


def _next(edges, now, period) -> RealScalar:
    """The first edge after now (s), at most the end of the period."""
    ahead = jnp.concatenate(edges)
    return jnp.minimum(jnp.min(jnp.where(ahead > now, ahead, period)), period)


def _later(running: Running, end, length, level, mean, torque) -> Running:
    """At the end (s) of a hold with these mean levels and this mean torque."""
    return Running(end, level, running.on_time + length * mean, running.impulse + length * torque)
