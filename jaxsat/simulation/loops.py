"""Closed loops: what an integrator sees of plant, controller and actuators together.

`ContinuousLoop` is the direct form; `jaxsat.simulation.error_coordinates` has another, in which the
printed three-axis law has no jumps. `SampledLoop` runs a sampled controller and holds its torque
in between.
"""

import abc
import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.checks import as_optional_float, concrete, require_counts, require_positive
from jaxsat.control import AbstractBacksteppingLaw, AbstractController, AbstractSampledController
from jaxsat.control.controller import Memory
from jaxsat.control.integrating_factor import AbstractIntegratingFactor
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.navigation import Navigation, NavigationState, Told
from jaxsat.simulation.trajectory import Signals
from jaxsat.vehicle import AbstractActuators, Actuators, DrawnSensors, Sensors


class AbstractLoop(eqx.Module):
    """A plant under control."""

    plant: eqx.AbstractVar[RigidBody]

    @abc.abstractmethod
    def start(self, state: PlantState) -> PyTree:
        """The loop's state when the plant is in `state` and the controller begins."""


class Motion(NamedTuple):
    """A loop at one instant: time derivative of its state, the plant's state with its ω_r (rad/s)
    and rate error η (rad/s), and the torque of the thrusters (N m)."""

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

    def is_smooth(self) -> bool:
        """Whether fixed steps suit the loop: no corner of the law or of actuators of a user's own.

        A thruster that reaches its limit is no corner here: a smooth law passes it in few steps.
        """
        own = isinstance(self.actuators, Actuators) or self.actuators.event_count == 0
        return own and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
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
        rate = LoopState(self.plant.rate(t, state.plant, torque), memory_rate)
        relative_rate = self.plant.relative_rate(state.plant)
        error = self.controller.rate_error(state.plant)
        return Motion(rate, state.plant, relative_rate, error, torque)

    def signals(self, t: Float[Array, ""], state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
        torque = self.motion(t, state).torque
        return continuous_signals(self.plant, self.controller, t, state.plant, state.memory, torque)

    def event_functions(self, t: Float[Array, ""], state: LoopState) -> Float[Array, " m"]:
        """Those of the controller and of the thrusters."""
        command, _ = self.controller(t, state.plant, state.memory)
        own = self.controller.event_functions(state.plant)
        return jnp.concatenate([own, self.actuators.event_functions(command)])

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ContinuousLoop":
        """Controller and thrusters held in a piece of theirs each."""
        count = signs.size - self.actuators.event_count
        held = (
            self.controller.smooth_piece(signs[:count]),
            self.actuators.smooth_piece(signs[count:]),
        )
        return eqx.tree_at(lambda loop: (loop.controller, loop.actuators), self, held)

    def integrating_factor(self, t: Float[Array, ""]) -> AbstractIntegratingFactor | None:
        """That of the controller."""
        return self.controller.integrating_factor(t)


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the torque (N m) now being made.

    `navigation` is that of sensors with a state and their estimator, None where there are none.
    """

    plant: PlantState
    memory: Memory
    torque: Float[Array, "3"]
    navigation: NavigationState | None = None


class Hold(NamedTuple):
    """A time during which the torque (N m) stays: `begin` and `length` in s, from the sample on."""

    begin: Float[Array, ""]
    length: Float[Array, ""]
    torque: Float[Array, "3"]


Integrator = Callable[[Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]]
"""Takes the time (s) at which a hold begins, the hold, the plant's state and a carry of its own;
gives the plant's state at the end of the hold, and the carry."""


class SampledLoop(AbstractLoop):
    """Plant and thrusters under a sampled controller whose torque is held between samples.

    The plant is integrated over each period in `substeps` equal steps. `sensors` stand between the
    true state and what the controller is told, or `navigation` does, whose sensors and estimator
    have a state; with None of either it is told the truth. A `delay` (s, at most one period) is the
    time the controller takes to compute: for so long after each sample the thrusters go on with
    what they did; None is a loop without. Each part of a delayed period is integrated in `substeps`
    steps of its own.
    """

    plant: RigidBody
    controller: AbstractSampledController
    actuators: AbstractActuators
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | DrawnSensors | None = None
    delay: Float[Array, ""] | None = eqx.field(converter=as_optional_float, default=None)
    navigation: Navigation | None = None

    def __check_init__(self):
        require_counts(substeps=self.substeps)
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
        navigation = None if self.navigation is None else self.navigation.init(state)
        begin = SampledState(state, None, jnp.zeros_like(state.omega), navigation)
        return begin._replace(memory=self.controller.init(self.told(jnp.array(0), begin).state))

    def told(self, number: Int[Array, ""], state: SampledState) -> Told:
        """What the controller is told at sample `number` of the run when the truth is `state`."""
        if self.navigation is not None and state.navigation is not None:
            period = self.controller.period
            return self.navigation.told(number, period, state.plant, state.navigation)
        if self.sensors is None:
            return Told(state.plant)
        attitude, omega = self.sensors(number, state.plant.attitude, state.plant.omega)
        return Told(PlantState(attitude, omega))

    def sample(
        self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState
    ) -> tuple[Float[Array, "3"], Memory, Signals, NavigationState | None]:
        """One run of the controller, sample `number` of the run at time `t` (s).

        Gives the torque that follows from it (N m), its next memory, the signals of the truth at
        this instant, and the next state of the navigation.
        """
        told = self.told(number, state)
        command, memory = self.controller.step(t, told.state, state.memory)
        torque = self.actuators(command)
        acting = torque
        if self.delay is not None:
            acting = jnp.where(self.delay > 0, state.torque, torque)
        signals = _sampled_signals(self, t, state.plant, memory, acting)
        signals = dataclasses.replace(signals, **told.errors)
        return torque, memory, signals, told.navigation

    def holds(self, state: SampledState, torque: Float[Array, "3"]) -> tuple[Hold, ...]:
        """The parts of a period that begins in `state` and whose sample asked for `torque`."""
        period = self.controller.period
        if self.delay is None:
            return (Hold(jnp.zeros_like(period), period, torque),)
        return (
            Hold(jnp.zeros_like(period), self.delay, state.torque),
            Hold(self.delay, period - self.delay, torque),
        )

    def period(
        self,
        number: Int[Array, ""],
        t: Float[Array, ""],
        state: SampledState,
        integrate: Callable[
            [Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]
        ],
        carry: PyTree,
    ) -> tuple[SampledState, PyTree, Signals]:
        """One period, that of sample `number` of the run, which is at time `t` (s).

        Gives the state at its end, the carry, and the signals at its begin.
        """
        torque, memory, signals, navigation = self.sample(number, t, state)
        plant = state.plant
        for hold in self.holds(state, torque):
            plant, carry = integrate(t + hold.begin, hold, plant, carry)
        plant = PlantState(plant.attitude.normalised(), plant.omega)
        return SampledState(plant, memory, torque, navigation), carry, signals

    def plant_rate(
        self, t: Float[Array, ""], state: PlantState, torque: Float[Array, "3"]
    ) -> PlantState:
        """The plant under a held torque, in the form diffrax integrates."""
        return self.plant.rate(t, state, torque)


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


def _sampled_signals(loop, t, state, memory, torque) -> Signals:
    error = loop.controller.rate_error(state, memory)
    none = jnp.full((), jnp.nan, error.dtype)
    mode = jnp.asarray(loop.controller.mode(memory), error.dtype)
    return _plant_signals(loop.plant, t, state, torque, error, none, mode)


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
    )
