"""The loop of a sampled controller, which runs once per period while effectors act in between."""

import dataclasses
from collections.abc import Callable
from functools import partial, reduce
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.control.controller import Memory
from jaxsat.control.navigation.navigation import LawInput, Navigation, NavigationState
from jaxsat.control.sampled import AbstractSampledController, Guard, GuardState
from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_optional_float, concrete, require_counts, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.simulation.divided_holds import through_hold
from jaxsat.simulation.loops import AbstractLoop, plant_signals
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft.distribution import AbstractDistribution, Direct, Shares
from jaxsat.spacecraft.dynamics import BodyMotion, OfEach, PlantState, RigidBody
from jaxsat.spacecraft.held_effector import GuardDecision, Hold, hold_by_hold, mean_size
from jaxsat.spacecraft.sensors import DrawnSensors, Sensors, Tachometers


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the memory of each effector.

    With a delay, `uses` are the last commands of the effectors. `navigation` is the state of
    sensors and their estimator, `guard` that of the guard, `momenta` are the last readings of
    tachometers that fail (N m s), None where there is none.
    """

    plant: PlantState
    memory: Memory
    effectors: OfEach = ()
    uses: OfEach | None = None
    navigation: NavigationState | None = None
    guard: GuardState | None = None
    momenta: Float[Array, " wheels"] | None = None


class _Planned(NamedTuple):
    """Decisions at a sample: the law's input, its shares, the effectors' plans, and memories."""

    law_input: LawInput
    shares: Shares
    plans: OfEach
    memory: Memory
    guard: GuardState | None
    decision: GuardDecision | None = None


Integrator = Callable[[RealScalar, Hold, PlantState, PyTree], tuple[PlantState, PyTree]]
"""Function of the time (s) at which a hold begins, the hold, the plant's state and a carry of its
own; returns the plant's state at the end of the hold, and the carry."""


class SampledLoop(AbstractLoop):
    """A plant under a sampled controller.

    The `distribution` divides a command among the plant's effectors. The plant is integrated
    between the instants at which an effector changes, in `substeps` equal steps each. The
    controller measures through `sensors`, or through `navigation`, whose sensors and estimator have
    a state; without either it receives the true state. A `delay` (s, at most one period) is the
    controller's computation time, during which effectors continue their previous commands; None is
    a loop without. `tachometers` measure the momenta of wheels; None for exact momenta. A `guard`
    acts at samples at which a tachometer is dead or has an outage, or a gyro that the estimator
    needs.
    """

    plant: RigidBody
    controller: AbstractSampledController
    distribution: AbstractDistribution = Direct()
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | DrawnSensors | None = None
    delay: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    navigation: Navigation | None = None
    tachometers: Tachometers | None = None
    guard: Guard | None = None

    def __check_init__(self):
        require_counts(substeps=self.substeps)
        navigation = self.navigation
        gyro = None if navigation is None or navigation.body else navigation.gyro
        for name, one in (("gyro", gyro), ("tachometer", self.tachometers)):
            if self.guard is None and one is not None and one.repeats:
                message = f"must be given with a {name} that fails or has an outage"
                raise ArgumentError("guard", message)
        if self.sensors is not None and self.navigation is not None:
            raise ValueError("Arguments `sensors` and `navigation` must not both be given.")
        if self.delay is None:
            return
        require_positive("delay", self.delay, zero_allowed=True)
        delay, period = concrete(self.delay), concrete(self.controller.period)
        if delay is not None and period is not None and not delay <= period:
            raise ArgumentError("delay", f"must not exceed the period {period} s", f"{delay} s")

    @property
    def tells_unmade(self) -> bool:
        """Whether law, distribution or an effector gives the torque that actuators do not make."""
        effectors = self.plant.effectors
        if self.controller.tells_unmade or self.distribution.tells_remainder(effectors):
            return True
        return any(one.unmade(one.idle()) is not None for one in effectors)

    def start(self, state: PlantState) -> SampledState:
        """The plant's state and initial memories, the controller's from the measured state."""
        state, effectors = self.plant.complete(state), self.plant.effectors
        begin = SampledState(
            state,
            None,
            tuple(one.init_memory() for one in effectors),
            None if self.delay is None else tuple(one.idle() for one in effectors),
            None if self.navigation is None else self.navigation.init(state),
            momenta=None if self.tachometers is None else self.tachometers.first_readings(),
        )
        law_input = self.law_input(jnp.array(0), begin).state
        begin = begin._replace(memory=self.controller.init(law_input))
        if self.guard is None:
            return begin
        return begin._replace(guard=self.guard.init(self._idle_shares()))

    def counts(self, state: SampledState) -> dict[str, Array]:
        """What the estimator has counted of each attitude sensor, by its column of a study."""
        if self.navigation is None or state.navigation is None:
            return {}
        return self.navigation.estimator.counts(state.navigation.memory)

    def law_input(self, number: IntScalar, state: SampledState) -> LawInput:
        """The controller's input at sample `number` of the run, from the true `state`."""
        plant, last = state.plant, state.momenta
        if self.tachometers is None:
            return self._law_input_of(number, plant, state.navigation)
        each = self.tachometers(number, plant.of_each)
        if last is not None:
            each, last = self.tachometers.read(number, self.controller.period, each, last)
        plant = dataclasses.replace(plant, effectors=each)
        law_input = self._law_input_of(number, plant, state.navigation)._replace(momenta=last)
        valid = self.tachometers.is_valid(number, self.controller.period)
        if valid is None:
            return law_input
        return law_input._replace(
            valid=valid if law_input.valid is None else valid & law_input.valid
        )

    def _law_input_of(
        self, number: IntScalar, plant: PlantState, navigation: NavigationState | None
    ) -> LawInput:
        """The controller's input for the true state of the body and measured momenta of wheels."""
        if self.navigation is not None and navigation is not None:
            return self.navigation.law_input(number, self.controller.period, plant, navigation)
        if self.sensors is None:
            return LawInput(plant)
        attitude, omega = self.sensors(number, plant.attitude, plant.omega)
        return LawInput(PlantState(attitude, omega, plant.effectors))

    def signals(self, number: IntScalar, t: RealScalar, state: SampledState) -> Signals:
        """The signals of the true state at sample `number` of the run, at time `t` (s)."""
        return self._signals_of(t, state, self._planned(number, t, state))

    def idle_signals(self, number: IntScalar, t: RealScalar, state: SampledState) -> Signals:
        """The `signals` without a step of the law, whose effectors are idle.

        They have the same structure, and are traced in a fraction of the time.
        """
        shares = self._idle_shares()
        plans = self._plans(t, shares.uses, state)
        idle = _Planned(self.law_input(number, state), shares, plans, state.memory, state.guard)
        return self._signals_of(t, state, idle)

    def _signals_of(self, t: RealScalar, state: SampledState, planned: _Planned) -> Signals:
        """The signals of a sample with these decisions."""
        parts = zip(self.plant.effectors, planned.plans, strict=True)
        means = [one.finish(plan, one.run(plan, self.controller.period))[1] for one, plan in parts]
        signals = self._signals(t, state, planned.memory, planned.law_input, tuple(means))
        return self._with_unmade(signals, planned.shares)

    def period(
        self,
        number: IntScalar,
        t: RealScalar,
        state: SampledState,
        integrate: Integrator,
        carry: PyTree,
    ) -> tuple[SampledState, PyTree, Signals]:
        """One period, from sample `number` of the run, at time `t` (s).

        Returns the state at its end, the carry, and the signals at its begin.
        """
        planned = self._planned(number, t, state)
        measurement, shares, plans, memory, guard, _ = planned
        plant, carry, running = self._through(t, plans, state, integrate, carry)
        parts = zip(self.plant.effectors, plans, running, strict=True)
        pairs = [one.finish(plan, now) for one, plan, now in parts]
        signals = self._signals(t, state, memory, measurement, tuple(mean for _, mean in pairs))
        after = SampledState(
            plant.normalised(),
            memory,
            tuple(own for own, _ in pairs),
            None if self.delay is None else shares.uses,
            self._with_torque(t, planned, state),
            guard,
            measurement.momenta,
        )
        return after, carry, self._with_unmade(signals, shares)

    def _planned(self, number: IntScalar, t: RealScalar, state: SampledState) -> _Planned:
        """The decisions at sample `number` of the run, at time `t` (s)."""
        law_input = self.law_input(number, state)
        shares, memory = self._shares(t, law_input.state, state.memory)
        guard, before = self.guard, state.guard
        if guard is None or before is None or law_input.valid is None:
            return _Planned(law_input, shares, self._plans(t, shares.uses, state), memory, before)
        decision = guard.decide(law_input.valid, before)
        shares, after = guard.command(decision, shares, before)
        memory = jax.tree.map(partial(jnp.where, law_input.valid), memory, state.memory)
        plans = self._plans(t, shares.uses, state, decision)
        return _Planned(law_input, shares, plans, memory, after, decision)

    def _with_torque(
        self, t: RealScalar, planned: _Planned, state: SampledState
    ) -> NavigationState | None:
        """The navigation's next state, with the torque commanded in the period that begins at `t`
        (s), N m: that of the body that a navigation knows, whose actuators obey."""
        following, navigation = planned.law_input.navigation, self.navigation
        if following is None or navigation is None or navigation.body is None:
            return following
        obeying = dataclasses.replace(self, plant=navigation.body)
        plans = obeying._plans(t, planned.shares.uses, state, planned.decision)
        parts = list(zip(navigation.body.effectors, plans, strict=True))
        commands = tuple(
            one.finish(plan, one.run(plan, self.controller.period))[1] for one, plan in parts
        )
        middle, estimate = t + self.controller.period / 2, planned.law_input.state
        torque = navigation.outer_torque(middle, estimate, commands)
        if self.delay is not None:
            before = obeying._before(state, commands)
            earlier = navigation.outer_torque(middle, estimate, before)
            torque = torque + self.delay / self.controller.period * (earlier - torque)
        return following._replace(torque=torque)

    def _shares(self, t: RealScalar, estimate: PlantState, memory: Memory) -> tuple[Shares, Memory]:
        """Each effector's share of the command at a sample, and the law's memory."""
        command, memory = self.controller.step(t, estimate, memory)
        return self.distribution(t, estimate, command, self.plant.effectors), memory

    def _idle_shares(self) -> Shares:
        """Shares of idle effectors, with the structure of those of a command."""
        effectors = self.plant.effectors
        rest = jnp.zeros(3) if self.distribution.tells_remainder(effectors) else None
        return Shares(tuple(one.idle() for one in effectors), rest)

    def _with_unmade(self, signals: Signals, shares: Shares) -> Signals:
        """The signals with the part of the commanded torque that effectors do not produce."""
        unmade = shares.torque_unmade(self.plant.effectors)
        if unmade is None:  # the law gives it, or nothing does
            return signals
        return dataclasses.replace(signals, torque_unmade=unmade)

    def _plans(
        self,
        t: RealScalar,
        uses: OfEach,
        state: SampledState,
        decision: GuardDecision | None = None,
    ) -> OfEach:
        """The plan of each effector for the period that begins at time `t` (s)."""
        parts = zip(self.plant.effectors, uses, state.effectors, strict=True)
        more = (self.controller.period, self.delay, decision)
        return tuple(one.plan(t, use, own, *more) for one, use, own in parts)

    def _before(self, state: SampledState, commands: OfEach) -> OfEach:
        """Commands until a sample's own are ready: the last ones, unless plans include the
        delay."""
        parts = zip(self.plant.effectors, state.uses or (), commands, strict=True)
        return tuple(now if one.plans_delay else last for one, last, now in parts)

    def _through(
        self, t, plans: OfEach, state: SampledState, integrate: Integrator, carry
    ) -> tuple[PlantState, PyTree, OfEach]:
        """The plant after the period that begins at time `t` (s), the carry, and the plans'
        progress."""
        body, period = self.plant, self.controller.period
        waits = self.delay is not None and not all(one.plans_delay for one in body.effectors)

        def step(now, running, plant, carry):
            parts = list(zip(body.effectors, plans, running, strict=True))
            ahead = [one.ahead(plan, mine, now, period) for one, plan, mine in parts]
            end = reduce(jnp.minimum, (each.until for each in ahead), period)
            commands = tuple(each.command for each in ahead)
            pieces = [(now, end, commands)]
            if waits:
                ready = jnp.clip(self.delay, now, end)
                later = body.later(commands, ready - now)
                pieces = [(now, ready, self._before(state, commands)), (ready, end, later)]
            for begin, stop, each in pieces:
                hold = Hold(begin, stop - begin)
                plant, carry = through_hold(body, each, t + begin, hold, plant, integrate, carry)
            ran = tuple(
                one.passed(plan, mine, each, now, end)
                for (one, plan, mine), each in zip(parts, ahead, strict=True)
            )
            return end, ran, plant, carry

        count = 1 + sum(one.holds - 1 for one in body.effectors)
        first = tuple(one.begin(plan) for one, plan in zip(body.effectors, plans, strict=True))
        running, plant, carry = hold_by_hold(count, period, step, first, state.plant, carry)
        return plant, carry, running

    def _signals(
        self, t, state: SampledState, memory, measurement: LawInput, means: OfEach
    ) -> Signals:
        """The signals of a sample, with means of commands that change within the period."""
        acting = means
        if self.delay is not None:
            before, delay = self._before(state, means), self.delay
            acting = jax.tree.map(lambda x, y: jnp.where(delay > 0, x, y), before, means)
        body, plant, law = self.plant, state.plant, self.controller
        error = law.rate_error(plant, memory)
        none, mode = jnp.full((), jnp.nan, error.dtype), jnp.asarray(law.mode(memory), error.dtype)
        struck = tuple(t >= times for times in body.failure_times)
        after = body.after_failures(plant, struck)
        driven, commands = body.driven(after, acting, struck)
        pieces = driven.pieces(driven.modes(t, after, commands), commands)
        motion = driven.motion(t, after, pieces=pieces)
        signals = plant_signals(body, t, plant, motion.torque, error, none, mode)
        parts, telemetry = (
            driven.signals(after, pieces, motion.rate.omega),
            dict(law.telemetry(memory)),
        )
        unmade = telemetry.pop("torque_unmade", None)
        signals = dataclasses.replace(signals, torque_unmade=unmade)
        return signals.with_parts(parts, measurement.errors, telemetry)

    def motion(
        self, t: RealScalar, state: PlantState, hold: Hold, elapsed: RealScalar
    ) -> BodyMotion:
        """The motion of the plant at `t` (s), `elapsed` seconds into a hold."""
        return self.plant.motion(t, state, pieces=self.plant.later(hold.pieces, elapsed))

    def mean_torque_size(self, t: RealScalar, state: PlantState, hold: Hold) -> Vector | None:
        """Mean |torque| about each axis, N m, over a hold that begins at `t` (s).

        None where the torque does not change linearly.
        """
        if not all(one.even for one in self.plant.effectors):
            return None
        first = self.motion(t, state, hold, jnp.zeros_like(hold.length)).torque
        return mean_size(first, self.motion(t + hold.length, state, hold, hold.length).torque)
