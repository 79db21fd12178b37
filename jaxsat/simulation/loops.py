"""Closed loops: what an integrator sees of plant, controller and actuators together.

`ContinuousLoop` is the direct form; `jaxsat.simulation.error_coordinates` has another, in which the
printed three-axis law has no jumps. `SampledLoop` runs a sampled controller and holds its torque
in between.
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.checks import as_optional_float, concrete, require_counts, require_positive
from jaxsat.control import AbstractBacksteppingLaw, AbstractController, AbstractSampledController
from jaxsat.control.controller import Memory
from jaxsat.control.integrating_factor import AbstractIntegratingFactor
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.simulation.trajectory import Signals
from jaxsat.simulation.wheel_holds import through_hold
from jaxsat.vehicle import (
    AbstractActuators,
    AbstractPulsedActuators,
    Actuators,
    ActuatorsWithWheels,
    DrawnSensors,
    Hold,
    Sensors,
    Usage,
)


class AbstractLoop(eqx.Module):
    """A plant under control."""

    plant: eqx.AbstractVar[RigidBody]

    @abc.abstractmethod
    def start(self, state: PlantState) -> PyTree:
        """The loop's state when the plant is in `state` and the controller begins."""


class Motion(NamedTuple):
    """A loop at one instant: time derivative of its state, the plant's state with its ω_r (rad/s)
    and rate error η (rad/s), and the torque of thrusters and wheels on the body (N m)."""

    rate: PyTree
    plant: PlantState
    relative_rate: Float[Array, "3"]
    rate_error: Float[Array, "2"]
    torque: Float[Array, "3"]


class AbstractContinuousLoop(AbstractLoop):
    """A loop that is one ordinary differential equation, smooth or in smooth pieces.

    A loop in pieces tells its event functions; with the sign of each held it is smooth.
    """

    @property
    @abc.abstractmethod
    def torque_count(self) -> int:
        """Torque beyond this many of its components is always zero."""

    @abc.abstractmethod
    def plant_state(self, state: PyTree) -> PlantState:
        """The plant's part of the state."""

    @abc.abstractmethod
    def motion(self, t: Float[Array, ""], state: PyTree) -> Motion:
        """Rates and torque at one instant."""

    @abc.abstractmethod
    def signals(self, t: Float[Array, ""], state: PyTree) -> Signals:
        """Everything worth saving at one instant."""

    @abc.abstractmethod
    def event_functions(self, t: Float[Array, ""], state: PyTree) -> Float[Array, " m"]:
        """Event functions: the loop is smooth while none of them changes its sign."""

    @abc.abstractmethod
    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractContinuousLoop":
        """The smooth loop that this one is where its event functions have these signs."""

    @abc.abstractmethod
    def integrating_factor(self, t: Float[Array, ""]) -> AbstractIntegratingFactor | None:
        """That of the state's `memory` at time `t` (s), if there is one."""

    def __call__(self, t: Float[Array, ""], state: PyTree, args: None = None) -> PyTree:
        """Time derivative of the loop's state, in the form diffrax integrates."""
        return self.motion(t, state).rate


class LoopState(NamedTuple):
    """State of the plant and memory of its controller."""

    plant: PlantState
    memory: Memory


class ContinuousLoop(AbstractContinuousLoop):
    """Plant, continuous controller and thrusters."""

    plant: RigidBody
    controller: AbstractController
    actuators: AbstractActuators

    def __check_init__(self):
        wheels = self.plant.wheels
        if wheels is not None and wheels.coulomb_friction is not None:
            raise ValueError(
                "Wheels with Coulomb friction must have a command that is held, which that of a "
                "continuous controller is not."
            )

    def is_smooth(self) -> bool:
        """Whether fixed steps suit the loop: no corner of the law, of actuators of a user's own or
        of wheels, whose torque ends at the limit of their momentum.

        A thruster or wheel that reaches the limit of its torque is no corner here: a smooth law
        passes it in few steps.
        """
        own = (Actuators, ActuatorsWithWheels)
        corners = 0 if isinstance(self.actuators, own) else self.actuators.event_count
        return not corners and not _wheel_events(self.plant) and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
        state = self.plant.with_wheel_momentum(state)
        return LoopState(state, self.controller.init(state))

    @property
    def torque_count(self) -> int:
        """Thrusters may turn about any axis."""
        return 3

    def plant_state(self, state: LoopState) -> PlantState:
        """It is a part."""
        return state.plant

    def motion(self, t: Float[Array, ""], state: LoopState) -> Motion:
        """Equations (1) and (36) under the controller's torque."""
        command, memory_rate = self.controller(t, state.plant, state.memory)
        torque = self.actuators(command)
        wheels = self._wheel_torque(state.plant, command)
        rate = LoopState(self.plant.rate(t, state.plant, torque, wheels), memory_rate)
        relative_rate = self.plant.relative_rate(state.plant)
        error = self.controller.rate_error(state.plant)
        torque = self.plant.control_torque(torque, wheels)
        return Motion(rate, state.plant, relative_rate, error, torque)

    def _wheel_torque(self, state: PlantState, command) -> Float[Array, " wheels"] | None:
        return self.plant.wheel_torque(state, self.actuators.wheel_command(command))

    def signals(self, t: Float[Array, ""], state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
        motion = self.motion(t, state)
        signals = continuous_signals(
            self.plant, self.controller, t, state.plant, state.memory, motion.torque
        )
        rate = motion.rate.plant.wheel_momentum
        return signals if rate is None else dataclasses.replace(signals, wheel_torque=-rate)

    def event_functions(self, t: Float[Array, ""], state: LoopState) -> Float[Array, " m"]:
        """Those of the controller, of the actuators and of the wheels' momenta."""
        command, _ = self.controller(t, state.plant, state.memory)
        own = self.controller.event_functions(state.plant)
        events = jnp.concatenate([own, self.actuators.event_functions(command)])
        if not _wheel_events(self.plant):
            return events
        share = self.actuators.wheel_command(command)
        return jnp.concatenate([events, self.plant.wheel_events(state.plant, share)])

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ContinuousLoop":
        """Controller, actuators and wheels held in a piece of theirs each."""
        wheels = signs.size - _wheel_events(self.plant)
        count = wheels - self.actuators.event_count
        held = (
            self.controller.smooth_piece(signs[:count]),
            self.actuators.smooth_piece(signs[count:wheels]),
        )
        made = eqx.tree_at(lambda loop: (loop.controller, loop.actuators), self, held)
        return dataclasses.replace(made, plant=self.plant.wheel_piece(signs[wheels:]))

    def integrating_factor(self, t: Float[Array, ""]) -> AbstractIntegratingFactor | None:
        """That of the controller."""
        return self.controller.integrating_factor(t)


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the torque (N m) now being made.

    Actuators that run once a period have a memory, and no torque is kept for them. `wheel_command`
    (N m) is what is now asked of each wheel, None without wheels.
    """

    plant: PlantState
    memory: Memory
    torque: Float[Array, "3"] | None
    actuators: PyTree = None
    wheel_command: Float[Array, " wheels"] | None = None


Integrator = Callable[[Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]]
"""Takes the time (s) at which a hold begins, the hold, the plant's state and a carry of its own;
gives the plant's state at the end of the hold, and the carry."""


class SampledLoop(AbstractLoop):
    """Plant and actuators under a sampled controller.

    The torque is held between samples, or changes at instants of the actuators' own. The plant is
    integrated over each time without such an instant in `substeps` equal steps. `sensors` stand
    between the true state and what the controller is told; None tells it the truth. A `delay` (s,
    at most one period) is the time the controller takes to compute: for so long after each sample
    the actuators go on with what they did; None is a loop without.
    """

    plant: RigidBody
    controller: AbstractSampledController
    actuators: AbstractActuators | AbstractPulsedActuators
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | DrawnSensors | None = None
    delay: Float[Array, ""] | None = eqx.field(converter=as_optional_float, default=None)

    def __check_init__(self):
        require_counts(substeps=self.substeps)
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
        memory = self.controller.init(self.measured(jnp.array(0), state))
        wheels = None if state.wheel_momentum is None else jnp.zeros_like(state.wheel_momentum)
        if isinstance(self.actuators, AbstractPulsedActuators):
            return SampledState(state, memory, None, self.actuators.init(), wheels)
        return SampledState(state, memory, jnp.zeros_like(state.omega), None, wheels)

    def measured(self, number: Int[Array, ""], state: PlantState) -> PlantState:
        """What the controller is told at sample `number` of the run when the truth is `state`."""
        if self.sensors is None:
            return state
        attitude, omega = self.sensors(number, state.attitude, state.omega)
        return PlantState(attitude, omega, state.wheel_momentum)

    def command(
        self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState
    ) -> tuple[Float[Array, " torques"], Memory]:
        """What the controller asks for at sample `number`, time `t` (s), and its next memory."""
        return self.controller.step(t, self.measured(number, state.plant), state.memory)

    def signals(self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState) -> Signals:
        """The signals of the truth at sample `number` of the run, which is at time `t` (s)."""
        command, memory = self.command(number, t, state)
        wheels = self._acting(state.wheel_command, self._wheel_command(state, command))
        if isinstance(self.actuators, AbstractPulsedActuators):
            usage = self.actuators.usage(*self._plan(t, command, state))
            return self._signals_of_usage(t, state.plant, memory, usage, wheels)
        acting = self._acting(state.torque, self.actuators(command))
        return _sampled_signals(self, t, state.plant, memory, acting, wheels)

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
        command, memory = self.command(number, t, state)
        if isinstance(self.actuators, AbstractPulsedActuators):
            after, carry, usage = self._pulsed(t, command, state, integrate, carry)
            wheels = self._acting(state.wheel_command, after.wheel_command)
            signals = self._signals_of_usage(t, state.plant, memory, usage, wheels)
            return after._replace(memory=memory), carry, signals
        torque, wheels = self.actuators(command), self._wheel_command(state, command)
        plant = state.plant
        acting = self._acting(state.torque, torque)
        wheels_acting = self._acting(state.wheel_command, wheels)
        signals = _sampled_signals(self, t, plant, memory, acting, wheels_acting)
        asked = (wheels,) if self.delay is None else (state.wheel_command, wheels)
        for hold, command in zip(self._holds(state, torque), asked, strict=True):
            plant, carry = through_hold(
                self.plant.wheels, command, t + hold.begin, hold, plant, integrate, carry
            )
        return SampledState(plant.normalised(), memory, torque, None, wheels), carry, signals

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

        def hold_by_hold(_, now):
            running, plant, carry = now
            hold, running = actuators.advance(plan, running)
            parts = ((hold, wheels),)
            if wheels is not None and self.delay is not None:
                before, after = hold.divided(self.delay)
                parts = ((before, state.wheel_command), (after, wheels))
            for part, asked in parts:
                plant, carry = through_hold(
                    self.plant.wheels, asked, t + part.begin, part, plant, integrate, carry
                )
            return running, plant, carry

        running, plant, carry = jax.lax.fori_loop(
            0, actuators.holds, hold_by_hold, (running, state.plant, carry)
        )
        memory, usage = actuators.finish(plan, running)
        after = SampledState(plant.normalised(), state.memory, None, memory, wheels)
        return after, carry, usage

    def _signals_of_usage(self, t, plant: PlantState, memory, usage: Usage, wheels) -> Signals:
        signals = _sampled_signals(self, t, plant, memory, usage.torque, wheels)
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


def _wheel_events(plant: RigidBody) -> int:
    """How many event functions the wheels of a plant have."""
    return 0 if plant.wheels is None else plant.wheels.event_count


def continuous_signals(plant, controller, t, state, memory, torque) -> Signals:
    """The signals of a continuous controller that asks for a torque (N m) at time `t` (s)."""

    def unmodelled(time):
        disturbance = plant.disturbance_torque(time, state)
        if isinstance(controller, AbstractBacksteppingLaw):
            disturbance = disturbance - controller.model.disturbance_torque(time, state)
        return disturbance[:2]

    torque_left, torque_left_rate = jax.jvp(unmodelled, (t,), (jnp.ones_like(t),))
    value = controller.lyapunov(state, memory, torque_left, torque_left_rate)
    error = controller.rate_error(state)
    return _plant_signals(plant, t, state, torque, error, value, jnp.zeros_like(value))


def _sampled_signals(loop, t, state, memory, torque, wheel_command) -> Signals:
    error = loop.controller.rate_error(state, memory)
    none = jnp.full((), jnp.nan, error.dtype)
    mode = jnp.asarray(loop.controller.mode(memory), error.dtype)
    wheels = loop.plant.wheel_torque(state, wheel_command)
    torque = loop.plant.control_torque(torque, wheels)
    signals = _plant_signals(loop.plant, t, state, torque, error, none, mode)
    return signals if wheels is None else dataclasses.replace(signals, wheel_torque=wheels)


def _plant_signals(plant, t, state, torque, rate_error, lyapunov, mode) -> Signals:
    wz = state.attitude.as_wz()
    return Signals(
        w=wz.w,
        z=wz.z,
        quaternion=state.attitude.as_quaternion().q,
        omega=state.omega,
        relative_rate=plant.relative_rate(state),
        torque=torque,
        disturbance=plant.disturbance_torque(t, state),
        rate_error=rate_error,
        lyapunov=lyapunov,
        mode=mode,
        constraint_torque=plant.constraint_torque(t, state, torque),
        wheel_momentum=state.wheel_momentum,
    )
