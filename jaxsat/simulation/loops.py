"""Closed loops: what an integrator sees of plant, controller and actuators together.

`ContinuousLoop` is the direct form; `jaxsat.simulation.error_coordinates` has another, in which the
printed three-axis law has no jumps, and `jaxsat.simulation.sampled_loop` one that runs a sampled
controller.
"""

import abc
import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control import AbstractBacksteppingLaw, AbstractController
from jaxsat.control.controller import AbstractIntegratingFactor, Memory
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft import AbstractActuators, Actuators, ActuatorsWithWheels
from jaxsat.spacecraft.dynamics import OfEach, PlantState, RigidBody, Struck


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
    def plant_state(self, t: Float[Array, ""], state: PyTree) -> PlantState:
        """The plant in a state of the loop at time `t` (s)."""

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
    """State of the plant, as if no wheel had seized, and memory of its controller.

    A wheel that seizes gives its momentum to the body at once. So that nothing that is integrated
    jumps, it keeps in `plant` the momentum with which it did; `ContinuousLoop.plant_state` has the
    state of the plant.
    """

    plant: PlantState
    memory: Memory


class _Acting(NamedTuple):
    """The plant's body as it is once failures have struck, the torque of thrusters on it (N m), and
    the command and the piece of each effector."""

    body: RigidBody
    torque: Float[Array, "3"]
    commands: OfEach
    pieces: OfEach


NEVER = 1e9
"""s; a failure later than this has no event function that grows."""


class ContinuousLoop(AbstractContinuousLoop):
    """Plant, continuous controller and thrusters.

    `struck` tells which failures of thrusters and then of the plant's effectors have struck, see
    `smooth_piece`; None is those whose time has come. Raises `ValueError` for an effector whose
    command must be held.
    """

    plant: RigidBody
    controller: AbstractController
    actuators: AbstractActuators
    struck: Bool[Array, " f"] | None = None

    def __check_init__(self):
        for one in self.plant.effectors:
            one.require_continuous()

    def is_smooth(self) -> bool:
        """Whether fixed steps suit the loop: no corner of the law, of actuators of a user's own or
        of wheels, whose torque ends at the limit of their momentum, and no failure in flight.

        A thruster or wheel that reaches the limit of its torque is no corner here: a smooth law
        passes it in few steps.
        """
        own = (Actuators, ActuatorsWithWheels)
        corners = 0 if isinstance(self.actuators, own) else self.actuators.event_count
        corners += self.failure_times.size + self.plant.event_count
        return not corners and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
        state = self.plant.complete(state)
        return LoopState(state, self.controller.init(state))

    @property
    def torque_count(self) -> int:
        """Thrusters may turn about any axis."""
        return 3

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When something fails, s: of the actuators, then of each effector of the plant."""
        return jnp.concatenate([self.actuators.failure_times, *self.plant.failure_times])

    def _struck(self, t: Float[Array, ""]) -> tuple[Bool[Array, " a"], Struck]:
        """Which failures of the actuators and of each effector have struck."""
        times = self.failure_times
        struck = t >= times if self.struck is None else self.struck
        sizes = [self.actuators.failure_times.size, *(x.size for x in self.plant.failure_times)]
        first, *others = [
            struck[end - size : end] for size, end in zip(sizes, np.cumsum(sizes), strict=True)
        ]
        return first, tuple(others)

    def plant_state(self, t: Float[Array, ""], state: LoopState) -> PlantState:
        """With the wheels that have seized at rest."""
        return self.plant.after_failures(state.plant, self._struck(t)[1])

    def _acting(self, t: Float[Array, ""], plant: PlantState, command) -> _Acting:
        """What acts on the plant at time `t` (s) on a command."""
        thrusters, others = self._struck(t)
        torque = self.actuators.after_failures(thrusters)(command)
        asked = self.plant.commands(self.actuators.commands(command))
        body, asked = self.plant.driven(plant, asked, others)
        pieces = body.pieces(body.modes(t, plant, torque, asked), asked)
        return _Acting(body, torque, asked, pieces)

    def motion(self, t: Float[Array, ""], state: LoopState) -> Motion:
        """Equations (1) and (36) under the controller's torque."""
        return self._motion(t, state)[0]

    def _motion(self, t: Float[Array, ""], state: LoopState) -> tuple[Motion, _Acting]:
        plant = self.plant_state(t, state)
        command, memory_rate = self.controller(t, plant, state.memory)
        acting = self._acting(t, plant, command)
        body, torque, _, pieces = acting
        rate = body.rate(t, plant, torque, pieces)
        relative_rate = self.plant.relative_rate(plant)
        error = self.controller.rate_error(plant)
        torque = body.control_torque(t, plant, torque, pieces, rate.omega)
        motion = Motion(LoopState(rate, memory_rate), plant, relative_rate, error, torque)
        return motion, acting

    def signals(self, t: Float[Array, ""], state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
        motion, acting = self._motion(t, state)
        signals = continuous_signals(
            self.plant, self.controller, t, motion.plant, state.memory, motion.torque
        )
        made = acting.body.signals(motion.plant, acting.pieces, motion.rate.plant.omega)
        command, _ = self.controller(t, motion.plant, state.memory)
        return dataclasses.replace(signals, torque_unmade=self.actuators.unmade(command), **made)

    def event_functions(self, t: Float[Array, ""], state: LoopState) -> Float[Array, " m"]:
        """Those of controller, actuators and effectors, and the time since each failure."""
        plant = self.plant_state(t, state)
        command, _ = self.controller(t, plant, state.memory)
        own = self.controller.event_functions(plant)
        events = [own, self.actuators.event_functions(command)]
        if self.plant.event_count:
            body, torque, asked, pieces = self._acting(t, plant, command)
            acceleration = body.acceleration(t, plant, torque, pieces)
            events.append(body.event_functions(plant, asked, acceleration))
        if self.failure_times.size:
            events.append(t - jnp.minimum(self.failure_times, NEVER))
        return jnp.concatenate(events)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ContinuousLoop":
        """Controller, actuators and effectors held in a piece of theirs each, failures as they
        are."""
        failures = self.failure_times.size
        signs, struck = signs[: signs.size - failures], signs[signs.size - failures :]
        effectors = signs.size - self.plant.event_count
        count = effectors - self.actuators.event_count
        held = (
            self.controller.smooth_piece(signs[:count]),
            self.actuators.smooth_piece(signs[count:effectors]),
        )
        made = eqx.tree_at(lambda loop: (loop.controller, loop.actuators), self, held)
        plant = self.plant.smooth_piece(signs[effectors:])
        return dataclasses.replace(made, plant=plant, struck=struck if failures else None)

    def integrating_factor(self, t: Float[Array, ""]) -> AbstractIntegratingFactor | None:
        """That of the controller."""
        return self.controller.integrating_factor(t)


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
    return plant_signals(plant, t, state, torque, error, value, jnp.zeros_like(value))


def plant_signals(plant, t, state, torque, rate_error, lyapunov, mode) -> Signals:
    """What is the same for all loops: the signals of a plant in `state` under a torque (N m)."""
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
        **plant.stored(state),
    )
