"""The loop of a sampled controller: once a period it runs, in between its actuators do."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.control import AbstractSampledController
from jaxsat.control.controller import Memory
from jaxsat.control.navigation import Navigation, NavigationState, Told
from jaxsat.control.steering import AbstractSteering
from jaxsat.core.checks import as_optional_float, concrete, require_counts, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.simulation.divided_holds import Asked, through_hold
from jaxsat.simulation.loops import AbstractLoop, plant_signals
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft import (
    AbstractActuators,
    AbstractPulsedActuators,
    DrawnSensors,
    Hold,
    Sensors,
    Tachometers,
    Usage,
)
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the torque (N m) now being made.

    Actuators that run once a period have a memory, and no torque is kept for them. `asked` is what
    is now asked of actuators that the torque does not tell. `navigation` is that of sensors with a
    state and their estimator, None where there are none.
    """

    plant: PlantState
    memory: Memory
    torque: Float[Array, "3"] | None
    actuators: PyTree = None
    asked: Asked = Asked()
    navigation: NavigationState | None = None


Integrator = Callable[[Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]]
"""Takes the time (s) at which a hold begins, the hold, the plant's state and a carry of its own;
gives the plant's state at the end of the hold, and the carry."""


class SampledLoop(AbstractLoop):
    """Plant and actuators under a sampled controller.

    The torque is held between samples, or changes at instants of the actuators' own. The plant is
    integrated over each time without such an instant in `substeps` equal steps. `sensors` stand
    between the true state and what the controller is told, or `navigation` does, whose sensors and
    estimator have a state; with None of either it is told the truth. A `delay` (s, at most one
    period) is the time the controller takes to compute: for so long after each sample the actuators
    continue from what they did; None is a loop without. What effectors of the plant make of a
    command by their own `steering` the `actuators` are not asked for. `tachometers` tell the
    momenta of wheels; None for those that are exact.
    """

    plant: RigidBody
    controller: AbstractSampledController
    actuators: AbstractActuators | AbstractPulsedActuators
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | DrawnSensors | None = None
    delay: Float[Array, ""] | None = eqx.field(converter=as_optional_float, default=None)
    navigation: Navigation | None = None
    steering: tuple[AbstractSteering, ...] = ()
    tachometers: Tachometers | None = None

    def __check_init__(self):
        require_counts(substeps=self.substeps)
        kinds = [one.kind for one in self.plant.effectors]
        for one in self.steering:
            if one.kind not in kinds:
                raise ArgumentError("steering", f"must be of effectors among {kinds}", one.kind)
        if self.sensors is not None and self.navigation is not None:
            raise ValueError("Arguments `sensors` and `navigation` must not both be given.")
        if self.delay is None:
            return
        require_positive("delay", self.delay, zero_allowed=True)
        delay, period = concrete(self.delay), concrete(self.controller.period)
        if delay is not None and period is not None and not delay <= period:
            raise ValueError(
                f"Argument `delay` must not exceed the period {period} s, but got {delay} s."
            )

    def start(self, state: PlantState) -> SampledState:
        """The plant's state, the controller's first memory for what is measured, and no torque."""
        state = self.plant.complete(state)
        torque, actuators = jnp.zeros_like(state.omega), None
        if isinstance(self.actuators, AbstractPulsedActuators):
            torque, actuators = None, self.actuators.init()
        begin = SampledState(
            state,
            None,
            torque,
            actuators,
            navigation=None if self.navigation is None else self.navigation.init(state),
        )
        told = self.told(jnp.array(0), begin).state
        memory = self.controller.init(told)
        return begin._replace(memory=memory, asked=self._nothing_asked(told, memory))

    def _nothing_asked(self, told: PlantState, memory: Memory) -> Asked:
        """What is asked of actuators before the first sample."""
        torque = None
        if self._actuators_fail:
            shape = jax.eval_shape(lambda: self.controller.step(jnp.zeros(()), told, memory)[0])
            torque = jnp.zeros(shape.shape, shape.dtype)
        return Asked(torque, self.plant.commands({}))

    def told(self, number: Int[Array, ""], state: SampledState) -> Told:
        """What the controller is told at sample `number` of the run when the truth is `state`."""
        told = self._told(number, state)
        if self.tachometers is None:
            return told
        measured = self.tachometers(number, told.state.of_each)
        return told._replace(state=dataclasses.replace(told.state, effectors=measured))

    def _told(self, number: Int[Array, ""], state: SampledState) -> Told:
        """With momenta of wheels as they are."""
        if self.navigation is not None and state.navigation is not None:
            period = self.controller.period
            return self.navigation.told(number, period, state.plant, state.navigation)
        if self.sensors is None:
            return Told(state.plant)
        plant = state.plant
        attitude, omega = self.sensors(number, plant.attitude, plant.omega)
        return Told(PlantState(attitude, omega, plant.effectors))

    def signals(self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState) -> Signals:
        """The signals of the truth at sample `number` of the run, which is at time `t` (s)."""
        told = self.told(number, state)
        command, asked, memory = self._commanded(t, told.state, state.memory)
        acting = self._acting(state.asked, asked)
        if isinstance(self.actuators, AbstractPulsedActuators):
            usage = self.actuators.usage(*self._plan(t, command, state))
            signals = self._signals_of_usage(t, state.plant, memory, told, usage, acting)
            return self._with_unmade(signals, command)
        torque = self._ideal_torque(t, command)
        return self._with_unmade(self._signals(t, state, memory, told, torque, acting), command)

    def _with_unmade(self, signals: Signals, command: Float[Array, " torques"]) -> Signals:
        """With what actuators do not make of a command."""
        return dataclasses.replace(signals, torque_unmade=self.actuators.unmade(command))

    def period(
        self,
        number: Int[Array, ""],
        t: Float[Array, ""],
        state: SampledState,
        integrate: Integrator,
        carry: PyTree,
    ) -> tuple[SampledState, PyTree, Signals]:
        """One period, that of sample `number` of the run, which is at time `t` (s).

        Gives the state at its end, the carry, and the signals at its begin.
        """
        told = self.told(number, state)
        command, asked, memory = self._commanded(t, told.state, state.memory)
        acting = self._acting(state.asked, asked)
        before, state = state, state._replace(memory=memory, navigation=told.navigation)
        if isinstance(self.actuators, AbstractPulsedActuators):
            after, carry, usage = self._pulsed(t, command, asked, state, integrate, carry)
            signals = self._signals_of_usage(t, state.plant, memory, told, usage, acting)
            return after, carry, self._with_unmade(signals, command)
        plant, torque = state.plant, self._ideal_torque(t, command)
        signals = self._signals(t, before, memory, told, torque, acting)
        through = (asked,) if self.delay is None else (state.asked, asked)
        for hold, one in zip(self._holds(state, torque), through, strict=True):
            plant, carry = self._through(one, t, hold, plant, integrate, carry)
        after = state._replace(plant=plant.normalised(), torque=torque, asked=asked)
        return after, carry, self._with_unmade(signals, command)

    def _commanded(
        self, t: Float[Array, ""], told: PlantState, memory: Memory
    ) -> tuple[Float[Array, " torques"], Asked, Memory]:
        """What is left for actuators to make of the law's command, what is asked of those that the
        torque does not tell, and the law's memory."""
        command, memory = self.controller.step(t, told, memory)
        asked = {}
        for one in self.steering:
            asked[one.kind], command = one(t, told, command)
        failing = command if self._actuators_fail else None
        asked |= self.actuators.commands(command)
        return command, Asked(failing, self.plant.commands(asked)), memory

    @property
    def _actuators_fail(self) -> bool:
        """Whether they are ideal ones that fail in flight."""
        actuators = self.actuators
        return isinstance(actuators, AbstractActuators) and actuators.failure_times.size > 0

    def _ideal_torque(self, t: Float[Array, ""], command) -> Float[Array, "3"]:
        """The torque of ideal actuators on a command at time `t` (s), N m."""
        actuators = cast(AbstractActuators, self.actuators)
        return actuators.after_failures(t >= actuators.failure_times)(command)

    def _acting(self, before: PyTree, asked: PyTree) -> PyTree:
        """What acts right after a sample: what it asked for or, with a delay, what did before."""
        delay = self.delay
        if delay is None:
            return asked
        return jax.tree.map(lambda x, y: jnp.where(delay > 0, x, y), before, asked)

    def _holds(self, state: SampledState, torque: Float[Array, "3"]) -> tuple[Hold, ...]:
        """The parts of a period that begins in `state` and whose sample asked for `torque`."""
        period = self.controller.period
        if self.delay is None:
            return (Hold(jnp.zeros_like(period), period, torque),)
        return (
            Hold(jnp.zeros_like(period), self.delay, cast(Array, state.torque)),
            Hold(self.delay, period - self.delay, torque),
        )

    def _through(self, asked: Asked, t, hold: Hold, plant, integrate: Integrator, carry):
        """The plant and the carry after a hold of the period that begins at time `t` (s)."""
        ideal = cast(AbstractActuators | None, None if asked.torque is None else self.actuators)
        begin = t + hold.begin
        return through_hold(self.plant, ideal, asked, begin, hold, plant, integrate, carry)

    def _plan(self, t, command, state: SampledState) -> tuple[PyTree, PyTree]:
        actuators = cast(AbstractPulsedActuators, self.actuators)
        return actuators.plan(t, command, state.actuators, self.controller.period, self.delay)

    def _pulsed(
        self, t, command, asked: Asked, state: SampledState, integrate: Integrator, carry
    ) -> tuple[SampledState, PyTree, Usage]:
        """A period from one instant of the actuators to the next."""
        actuators = cast(AbstractPulsedActuators, self.actuators)
        plan, running = self._plan(t, command, state)

        def through(running, plant, carry):
            hold, running = actuators.advance(plan, running)
            parts = ((hold, asked),)
            if self.plant.effectors and self.delay is not None:
                before, after = hold.divided(self.delay)
                parts = ((before, state.asked), (after, asked))
            for part, one in parts:
                plant, carry = self._through(one, t, part, plant, integrate, carry)
            return running, plant, carry

        running, plant, carry = actuators.hold_by_hold(plan, running, through, state.plant, carry)
        memory, usage = actuators.finish(plan, running)
        after = state._replace(plant=plant.normalised(), actuators=memory, asked=asked)
        return after, carry, usage

    def _signals_of_usage(self, t, plant, memory, told: Told, usage: Usage, asked) -> Signals:
        signals = _sampled_signals(self, t, plant, memory, told, usage.torque, asked)
        return dataclasses.replace(
            signals,
            thrust_level=usage.level,
            propellant=usage.propellant,
            valve_openings=usage.openings,
        )

    def _signals(self, t, state: SampledState, memory, told: Told, torque, asked) -> Signals:
        """Those of ideal actuators that would now make a torque (N m)."""
        acting = self._acting(state.torque, torque)
        return _sampled_signals(self, t, state.plant, memory, told, acting, asked)

    def plant_rate(
        self, t: Float[Array, ""], state: PlantState, hold: Hold, elapsed: Float[Array, ""]
    ) -> PlantState:
        """Time derivative of the plant `elapsed` seconds after a hold began, at time `t` (s)."""
        return self.plant.rate(t, state, hold.torque_after(elapsed), hold.pieces)

    def torque(
        self, t: Float[Array, ""], state: PlantState, hold: Hold, elapsed: Float[Array, ""]
    ) -> Float[Array, "3"]:
        """The torque of all actuators at `t` (s), `elapsed` seconds after a hold began, N m."""
        torque, pieces = hold.torque_after(elapsed), hold.pieces
        if not pieces:
            return torque
        acceleration = self.plant.acceleration(t, state, torque, pieces)
        return self.plant.control_torque(t, state, torque, pieces, acceleration)


def _sampled_signals(loop, t, state, memory, told: Told, torque, asked: Asked) -> Signals:
    error = loop.controller.rate_error(state, memory)
    none = jnp.full((), jnp.nan, error.dtype)
    mode = jnp.asarray(loop.controller.mode(memory), error.dtype)
    struck = tuple(t >= times for times in loop.plant.failure_times)
    after = loop.plant.after_failures(state, struck)
    body, commands = loop.plant.driven(after, asked.effectors, struck)
    pieces = body.pieces(body.modes(t, after, torque, commands), commands)
    acceleration = body.acceleration(t, after, torque, pieces)
    torque = body.control_torque(t, after, torque, pieces, acceleration)
    signals = plant_signals(loop.plant, t, state, torque, error, none, mode)
    made, telemetry = body.signals(after, pieces, acceleration), loop.controller.telemetry(memory)
    return dataclasses.replace(signals, **made, **told.errors, **telemetry)
