"""Thrusters whose valves open and shut inside a control period, at exact instants."""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.smooth import at_least, within
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.effector import AbstractEffector, Effect, Reach
from jaxsat.spacecraft.failures import FailureEvents, ThrusterCondition
from jaxsat.spacecraft.held_effector import Ahead
from jaxsat.spacecraft.least_propellant import LeastPropellant
from jaxsat.spacecraft.modulation import AbstractModulation, Pulses
from jaxsat.spacecraft.thrusters import DISPERSIBLE, ThrusterSet

ROUNDING = 1e-13
"""Tolerance, over a period, on coincident ends of ramps, and of pulses with the period."""


class ThrusterMemory(NamedTuple):
    """The modulator's memory, the pulses of the last period, and totals since the start.

    `level` is the thrust of each thruster over its full one, None for instant rise and fall; `open`
    marks valves with an open command at the end. `pulses` is None where no valve can be late.
    `openings` counts the openings of each valve.
    """

    modulation: PyTree
    pulses: Pulses | None
    level: Float[Array, " m"] | None
    open: Bool[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class PulsePlan(NamedTuple):
    """Pulses of a period that begins at `t` (s), and those of the last one that continue in it.

    `before` is the level of each thruster as in `ThrusterMemory`, `memory` is the memory of the
    next period but for the consumption until then.
    """

    t: RealScalar
    period: RealScalar
    pulses: Pulses
    before: Float[Array, " m"] | None
    memory: ThrusterMemory


class Running(NamedTuple):
    """Running totals up to an instant of a period.

    `level` of each thruster is as in `ThrusterMemory`, `propellant` (kg) the consumption, `on_time`
    ∫ level dt (s) and `impulse` ∫ torque dt (N m s).
    """

    level: Float[Array, " m"] | None
    propellant: RealScalar
    on_time: Float[Array, " m"]
    impulse: Vector


class _Level(NamedTuple):
    """Levels in a hold: at its begin, their slopes (1/s), their `target`, and the time (s) of
    arrival there. Without ramps they are the target."""

    level: Float[Array, " m"]
    slope: Float[Array, " m"] | None
    target: Float[Array, " m"]
    arrival: Float[Array, " m"] | None


class Usage(NamedTuple):
    """Usage of thrusters in a period.

    `level` is the mean thrust of each over its full one. `propellant` (kg) and `openings` of each
    valve are totals since the start of the run.
    """

    level: Float[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class ThrusterTorque(NamedTuple):
    """Torque of all thrusters (N m), and its rate of change (N m/s), None if constant.

    `usage` is that of a period over which the torque is the mean.
    """

    torque: Vector
    rate: Vector | None = None
    usage: Usage | None = None


class PulsedThrusters(AbstractEffector):
    """Allocation, modulation, valves and failures of a set of one-sided thrusters.

    They run once a period; in a hold their command is a `ThrusterTorque`.

    Without an `allocation` the law commands the duty of each.
    Where valves may be `late`, by a delay of the valve, of the law or of a failure, pulses extend
    into the next period; `late` must also be true where a guard may repeat pulses. A delay of more
    than a period counts as one; thrust must rise and fall within a period.
    """

    kind: ClassVar[str] = "thruster"
    even: ClassVar[bool] = True
    plans_delay: ClassVar[bool] = True
    dispersible: ClassVar[Mapping[str, Dispersible]] = DISPERSIBLE

    thrusters: ThrusterSet
    allocation: LeastPropellant | None
    modulation: AbstractModulation
    failures: FailureEvents | None = None
    late: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.thrusters.valve_delay is not None and not self.late:
            raise ValueError("Argument `late` must be true for thrusters with a `valve_delay`.")

    def misaligned(self, angles: Float[Array, "m 2"]) -> "PulsedThrusters":
        """Return thrusters with turned torques, see `ThrusterSet.misaligned`."""
        return self._of_others(self.thrusters.misaligned(angles))

    def stronger(self, change: Float[Array, " m"]) -> "PulsedThrusters":
        """Return thrusters with 1 + `change` times their torque, see `ThrusterSet.stronger`."""
        return self._of_others(self.thrusters.stronger(change))

    def _of_others(self, thrusters: ThrusterSet) -> "PulsedThrusters":
        changed = eqx.tree_at(lambda one: one.thrusters, self, thrusters)
        if self.failures is None:
            return changed
        failures = self.failures.of_others(self.thrusters.torque, thrusters.torque)
        return eqx.tree_at(lambda one: one.failures, changed, failures)

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.thrusters.count

    @property
    def command_size(self) -> int:
        """Number of components of the command: the shared torques, or a duty for each thruster."""
        return self.allocation.command_map.shape[1] if self.allocation else self.count

    @property
    def failure_times(self) -> Float[Array, "0"]:
        """An empty array, as failures divide the plan into holds."""
        return jnp.zeros(0)

    @property
    def holds(self) -> int:
        """Largest number of holds of a plan: edges of commands, failures and ramps, plus one."""
        count = self.count
        edges = self.modulation.edges(self.allocation.between if self.allocation else count, count)
        if self.late:
            edges = 2 * (edges + count)
        edges += 0 if self.failures is None else self.failures.count
        if self.thrusters.ramps:
            edges += edges + count
        return edges + 1

    def init_memory(self) -> ThrusterMemory:
        """Return the initial memory: all valves shut, and totals of zero."""
        count = self.count
        zero, modulation = jnp.zeros(count), self.modulation.init(count)
        pulses = None
        if self.late:
            first = self._pulses(self.idle(), modulation, jnp.ones_like(zero[0]))[0]
            pulses = Pulses(first.on, 0 * first.off, 0 * first.level)
        level = zero if self.thrusters.ramps else None
        return ThrusterMemory(modulation, pulses, level, zero > 0, zero[0], zero)

    def duties(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Return duties, mean fractions of full thrust over a period, for the law's command."""
        if self.allocation is None:
            return within(command, jnp.zeros_like(command), jnp.ones_like(command))
        return self.allocation(command)[0]

    def unmade(self, use: Float[Array, " torques"]) -> Vector | None:
        """Return the torque beyond all duties, N m; None where the law commands duties."""
        return None if self.allocation is None else self.allocation(use)[1]

    def _pulses(self, command, modulation, period) -> tuple[Pulses, PyTree]:
        """Return pulses and the modulator's next memory; a pulse to the period's end is exact."""
        duty = self.duties(command)
        pulses, modulation = self.modulation(duty, modulation, period, self.thrusters.min_on_time)
        to_end = pulses.off >= period * (1 - ROUNDING)
        return pulses._replace(off=jnp.where(to_end, period, pulses.off)), modulation

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """Return opening and closing times (s from the sample), and the thrust level, by name."""
        least = self.thrusters.min_on_time
        pulses, memory = self.modulation(self.duties(use), memory, period, least)
        return dict(zip(("valve_on", "valve_off", "level"), pulses, strict=True)), memory

    def modulator(self, memory: ThrusterMemory) -> PyTree:
        """Return the memory of the modulation."""
        return memory.modulation

    def plan(self, t, use, memory, period, delay, decision=None) -> PulsePlan:
        """Return the commanded pulses, shifted by the delays of the valves.

        Where the law makes no step they are the pulses of the last period, or none, and the
        modulator's memory stays. Raises `ValueError` for a delay, or a law that may make no step,
        without remembered pulses (`late`).
        """
        pulses, modulation = self._pulses(use, memory.modulation, period)
        if decision is not None:
            if memory.pulses is None:
                raise ValueError("Argument `late` must be true for a loop with a guard.")
            again = jax.tree.map(lambda x: jnp.where(decision.held, x, 0), memory.pulses)
            pulses, modulation = jax.tree.map(
                lambda new, old: jnp.where(decision.steps, new, old),
                (pulses, modulation),
                (again, memory.modulation),
            )
        acts = pulses.off > pulses.on
        late = self._lateness(t, period, delay) if self.late else jnp.zeros_like(memory.openings)
        failures = self.failures
        if failures is not None:
            acts = acts & jax.vmap(lambda on: failures.opens(t, on + late))(pulses.on)
        begins = acts & ~((pulses.on <= 0) & memory.open[None])
        per_opening = 1.0 if self.modulation.counts_openings() else 0.0
        openings = jnp.sum(begins, axis=0, dtype=memory.openings.dtype)
        following = memory._replace(
            modulation=modulation,
            pulses=pulses if self.late else None,
            open=jnp.any(acts & (pulses.off >= period), axis=0),
            openings=memory.openings + per_opening * openings,
        )
        if self.late:
            pulses = _late(pulses, memory.pulses, period, late)
        elif delay is not None:
            raise ValueError("Argument `late` must be true for a loop with a delay.")
        return PulsePlan(t, period, pulses, memory.level, following)

    def _lateness(self, t, period, delay) -> Float[Array, " m"]:
        """Return the delay of each valve, s."""
        late = self._condition(t, jnp.zeros_like(period)).delay
        for more in (self.thrusters.valve_delay, delay):
            late = late if more is None else late + more
        return jnp.minimum(late, period)

    def _condition(self, t: RealScalar, now: RealScalar) -> ThrusterCondition:
        if self.failures is None:
            return ThrusterCondition.sound(self.thrusters.torque)
        return self.failures.condition(t, now, self.thrusters.torque)

    def reach(self, t, plant, state: None, struck, span) -> Reach:
        """Return the reach in duties, from the leak to the remaining part of full thrust."""
        condition = ThrusterCondition.sound(self.thrusters.torque)
        if self.failures is not None:
            condition = self.failures.at_work(struck, self.thrusters.torque)
        high = jnp.maximum(condition.gain, condition.floor)
        return Reach(condition.torque, condition.floor, high, self.thrusters.flow)

    def begin(self, plan: PulsePlan) -> Running:
        """Return the running totals at the begin of a period: zeros."""
        zero = jnp.zeros_like(plan.memory.openings)
        return Running(plan.before, zero[0], zero, jnp.zeros(3, zero.dtype))

    def ahead(self, plan: PulsePlan, running: Running, now, period) -> Ahead:
        """Return the torque up to the next edge of a command, of a failure or of a ramp."""
        pulses = plan.pulses
        condition = self._condition(plan.t, now)
        acting = (pulses.on <= now) & (now < pulses.off)
        commanded = jnp.sum(jnp.where(acting, pulses.level, 0.0), axis=0)
        target = at_least(condition.gain * commanded, condition.floor)
        edges = [pulses.on.ravel(), pulses.off.ravel()]
        if self.failures is not None:
            edges.append(self.failures.at - plan.t)
        if not self.thrusters.ramps:
            torque = ThrusterTorque(condition.torque @ target)
            return Ahead(_next(edges, now, period), torque, _Level(target, None, target, None))
        level, slope, arrival = self._ramps(now, cast(Array, running.level), target)
        torque = ThrusterTorque(condition.torque @ level, condition.torque @ slope)
        until = _next([*edges, arrival], now, period)
        return Ahead(until, torque, _Level(level, slope, target, arrival))

    def passed(self, plan: PulsePlan, running: Running, ahead: Ahead, now, end) -> Running:
        """Return the running totals after a hold."""
        length, (level, slope, target, arrival) = end - now, ahead.own
        after, mean, torque = None, level, ahead.command.torque
        if slope is not None and arrival is not None:
            arrived = arrival <= end + ROUNDING * plan.period
            after = jnp.where(arrived, target, level + slope * length)
            mean = level + slope * (length / 2)
            torque = self.later(ahead.command, length / 2).torque
        return Running(
            after,
            running.propellant + length * jnp.sum(self.thrusters.flow * mean),
            running.on_time + length * mean,
            running.impulse + length * torque,
        )

    def _ramps(self, now, level, target):
        """Return levels now, their slopes (1/s), and their times of arrival (s)."""
        rise, fall = cast(Array, self.thrusters.rise_time), cast(Array, self.thrusters.fall_time)
        rises = target > level
        times = jnp.where(rises, rise, fall)
        moves = (target != level) & (times > 0)
        slope = jnp.where(rises, 1.0, -1.0) / jnp.where(moves, times, 1.0)
        arrival = now + jnp.abs(target - level) * times
        return jnp.where(moves, level, target), jnp.where(moves, slope, 0.0), arrival

    def finish(self, plan: PulsePlan, running: Running) -> tuple[ThrusterMemory, ThrusterTorque]:
        """Return the memory with new totals, and the mean torque with the usage of the period."""
        propellant = plan.memory.propellant + running.propellant
        memory = plan.memory._replace(level=running.level, propellant=propellant)
        usage = Usage(running.on_time / plan.period, propellant, memory.openings)
        return memory, ThrusterTorque(running.impulse / plan.period, usage=usage)

    def consumption(self, memory: ThrusterMemory) -> dict[str, Array]:
        """Return propellant (kg) and openings of valves up to a sample, by name."""
        return {"propellant": memory.propellant, "valve_openings": memory.openings}

    # Behaviour in a hold.

    def driven(
        self, state: None, command: ThrusterTorque, struck: Bool[Array, "0"]
    ) -> "tuple[PulsedThrusters, ThrusterTorque]":
        """Return these thrusters and their torque unchanged: the torque includes failures."""
        return self, command

    def later(self, command: ThrusterTorque, elapsed: RealScalar) -> ThrusterTorque:
        """Return the torque `elapsed` seconds later."""
        if command.rate is None:
            return command
        return command._replace(torque=command.torque + elapsed * command.rate)

    def piece(self, mode: tuple, command: ThrusterTorque) -> ThrusterTorque:
        """Return the torque unchanged."""
        return command

    def effect(self, piece: ThrusterTorque, t, plant, state: None) -> Effect:
        """Return the torque on the body (N m), with no correction of its inertia."""
        return Effect(piece.torque)

    def signals(self, piece: ThrusterTorque, state: None, acceleration) -> dict[str, Array]:
        """Return the usage of a period, by name; empty where it is unknown."""
        if piece.usage is None:
            return {}
        level, propellant, openings = piece.usage
        return {"thrust_level": level, "propellant": propellant, "valve_openings": openings}

    def require_continuous(self) -> None:
        """Raise `ValueError`: valves open and shut between samples."""
        raise ValueError(
            "Thrusters that pulse must have a sampled law, which a continuous controller is not."
        )


def _late(pulses: Pulses, before: Pulses, period, late) -> Pulses:
    """Return the pulses of the last period and of this one, which begins at 0, all `late` (s)."""
    late = late[None]
    return Pulses(
        jnp.concatenate([before.on + (late - period), pulses.on + late]),
        jnp.concatenate([before.off + (late - period), pulses.off + late]),
        jnp.concatenate([before.level, pulses.level]),
    )


def _next(edges, now, period) -> RealScalar:
    """Return the first edge after now (s), at most the end of the period."""
    ahead = jnp.concatenate(edges)
    return jnp.minimum(jnp.min(jnp.where(ahead > now, ahead, period)), period)
