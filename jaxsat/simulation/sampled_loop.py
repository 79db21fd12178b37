"""The loop of a sampled controller: once a period it runs, in between its actuators do."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.checks import as_optional_float, concrete, require_counts, require_positive
from jaxsat.control import AbstractSampledController
from jaxsat.control.controller import Memory
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.navigation import Navigation, NavigationState, Told
from jaxsat.simulation.loops import AbstractLoop, plant_signals
from jaxsat.simulation.trajectory import Signals
from jaxsat.simulation.wheel_holds import through_hold
from jaxsat.vehicle import (
    AbstractActuators,
    AbstractPulsedActuators,
    DrawnSensors,
    Hold,
    Sensors,
    Usage,
)


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the torque (N m) now being made.

    Actuators that run once a period have a memory, and no torque is kept for them. `wheel_command`
    (N m) is what is now asked of each wheel, None without wheels. `navigation` is that of sensors
    with a state and their estimator, None where there are none.
    """

    plant: PlantState
    memory: Memory
    torque: Float[Array, "3"] | None
    actuators: PyTree = None
    wheel_command: Float[Array, " wheels"] | None = None
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
    continue from what they did; None is a loop without.
    """

    plant: RigidBody
    controller: AbstractSampledController
    actuators: AbstractActuators | AbstractPulsedActuators
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | DrawnSensors | None = None
    delay: Float[Array, ""] | None = eqx.field(converter=as_optional_float, default=None)
    navigation: Navigation | None = None

    def __check_init__(self):
        require_counts(substeps=self.substeps)
        if self.sensors is not None and self.navigation is not None:
            raise ValueError("Arguments `sensors` and `navigation` must not both be given.")
        if isinstance(self.actuators, AbstractActuators) and self.actuators.failure_times.size:
            raise ValueError("Failures of ideal actuators must be those of a continuous loop.")
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
        state = self.plant.with_wheel_momentum(state)
        torque, actuators = jnp.zeros_like(state.omega), None
        if isinstance(self.actuators, AbstractPulsedActuators):
            torque, actuators = None, self.actuators.init()
        begin = SampledState(
            state,
            None,
            torque,
            actuators,
            None if state.wheel_momentum is None else jnp.zeros_like(state.wheel_momentum),
            None if self.navigation is None else self.navigation.init(state),
        )
        return begin._replace(memory=self.controller.init(self.told(jnp.array(0), begin).state))

    def told(self, number: Int[Array, ""], state: SampledState) -> Told:
        """What the controller is told at sample `number` of the run when the truth is `state`."""
        if self.navigation is not None and state.navigation is not None:
            period = self.controller.period
            return self.navigation.told(number, period, state.plant, state.navigation)
        if self.sensors is None:
            return Told(state.plant)
        plant = state.plant
        attitude, omega = self.sensors(number, plant.attitude, plant.omega)
        return Told(PlantState(attitude, omega, plant.wheel_momentum))

    def signals(self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState) -> Signals:
        """The signals of the truth at sample `number` of the run, which is at time `t` (s)."""
        told = self.told(number, state)
        command, memory = self.controller.step(t, told.state, state.memory)
        wheels = self._acting(state.wheel_command, self._wheel_command(state, command))
        if isinstance(self.actuators, AbstractPulsedActuators):
            usage = self.actuators.usage(*self._plan(t, command, state))
            return self._signals_of_usage(t, state.plant, memory, told, usage, wheels)
        acting = self._acting(state.torque, self.actuators(command))
        return _sampled_signals(self, t, state.plant, memory, told, acting, wheels)

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
        command, memory = self.controller.step(t, told.state, state.memory)
        state = state._replace(memory=memory, navigation=told.navigation)
        if isinstance(self.actuators, AbstractPulsedActuators):
            after, carry, usage = self._pulsed(t, command, state, integrate, carry)
            wheels = self._acting(state.wheel_command, after.wheel_command)
            signals = self._signals_of_usage(t, state.plant, memory, told, usage, wheels)
            return after, carry, signals
        torque, wheels = self.actuators(command), self._wheel_command(state, command)
        plant = state.plant
        acting = self._acting(state.torque, torque)
        wheels_acting = self._acting(state.wheel_command, wheels)
        signals = _sampled_signals(self, t, plant, memory, told, acting, wheels_acting)
        asked = (wheels,) if self.delay is None else (state.wheel_command, wheels)
        for hold, command in zip(self._holds(state, torque), asked, strict=True):
            plant, carry = through_hold(
                self.plant, command, t + hold.begin, hold, plant, integrate, carry
            )
        after = state._replace(plant=plant.normalised(), torque=torque, wheel_command=wheels)
        return after, carry, signals

    def _acting(self, before: Array | None, asked: Array | None) -> Array | None:
        """What acts right after a sample: what it asked for or, with a delay, what did before."""
        if self.delay is None or asked is None:
            return asked
        return jnp.where(self.delay > 0, cast(Array, before), asked)

    def _wheel_command(self, state: SampledState, command) -> Float[Array, " wheels"] | None:
        """What a command asks of each wheel (N m): zero where the actuators have none of them."""
        if state.wheel_command is None:
            return None
        asked = self.actuators.wheel_command(command)
        return jnp.zeros_like(state.wheel_command) if asked is None else asked

    def _holds(self, state: SampledState, torque: Float[Array, "3"]) -> tuple[Hold, ...]:
        """The parts of a period that begins in `state` and whose sample asked for `torque`."""
        period = self.controller.period
        if self.delay is None:
            return (Hold(jnp.zeros_like(period), period, torque),)
        return (
            Hold(jnp.zeros_like(period), self.delay, cast(Array, state.torque)),
            Hold(self.delay, period - self.delay, torque),
        )

    def _plan(self, t, command, state: SampledState) -> tuple[PyTree, PyTree]:
        actuators = cast(AbstractPulsedActuators, self.actuators)
        return actuators.plan(t, command, state.actuators, self.controller.period, self.delay)

    def _pulsed(
        self, t, command, state: SampledState, integrate: Integrator, carry
    ) -> tuple[SampledState, PyTree, Usage]:
        """A period from one instant of the actuators to the next."""
        actuators = cast(AbstractPulsedActuators, self.actuators)
        wheels = self._wheel_command(state, command)
        plan, running = self._plan(t, command, state)

        def through(running, plant, carry):
            hold, running = actuators.advance(plan, running)
            parts = ((hold, wheels),)
            if wheels is not None and self.delay is not None:
                before, after = hold.divided(self.delay)
                parts = ((before, state.wheel_command), (after, wheels))
            for part, asked in parts:
                plant, carry = through_hold(
                    self.plant, asked, t + part.begin, part, plant, integrate, carry
                )
            return running, plant, carry

        running, plant, carry = actuators.hold_by_hold(plan, running, through, state.plant, carry)
        memory, usage = actuators.finish(plan, running)
        after = state._replace(plant=plant.normalised(), actuators=memory, wheel_command=wheels)
        return after, carry, usage

    def _signals_of_usage(self, t, plant, memory, told: Told, usage: Usage, wheels) -> Signals:
        signals = _sampled_signals(self, t, plant, memory, told, usage.torque, wheels)
        return dataclasses.replace(
            signals,
            thrust_level=usage.level,
            propellant=usage.propellant,
            valve_openings=usage.openings,
        )

    def plant_rate(
        self, t: Float[Array, ""], state: PlantState, hold: Hold, elapsed: Float[Array, ""]
    ) -> PlantState:
        """Time derivative of the plant `elapsed` seconds after a hold began, at time `t` (s)."""
        wheels = hold.wheel_torque(state.wheel_momentum)
        return self.plant.rate(t, state, hold.torque_after(elapsed), wheels)

    def torque(self, state: PlantState, hold: Hold, elapsed: Float[Array, ""]) -> Float[Array, "3"]:
        """The torque of all actuators `elapsed` seconds after a hold began, N m."""
        wheels = hold.wheel_torque(state.wheel_momentum)
        return self.plant.control_torque(hold.torque_after(elapsed), wheels)


def _sampled_signals(loop, t, state, memory, told: Told, torque, wheel_command) -> Signals:
    error = loop.controller.rate_error(state, memory)
    none = jnp.full((), jnp.nan, error.dtype)
    mode = jnp.asarray(loop.controller.mode(memory), error.dtype)
    wheels = loop.plant.wheel_torque(state, wheel_command, t)
    torque = loop.plant.control_torque(torque, wheels)
    signals = plant_signals(loop.plant, t, state, torque, error, none, mode)
    telemetry = loop.controller.telemetry(memory)
    return dataclasses.replace(signals, wheel_torque=wheels, **told.errors, **telemetry)
