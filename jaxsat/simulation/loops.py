"""Closed loops: what an integrator sees of plant, controller and actuators together.

`ContinuousLoop` is the direct form; `jaxsat.simulation.error_coordinates` has another, in which the
printed three-axis law has no jumps, and `jaxsat.simulation.sampled_loop` one that runs a sampled
controller.
"""

import abc
import dataclasses
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control import AbstractBacksteppingLaw, AbstractController
from jaxsat.control.controller import Memory
from jaxsat.control.integrating_factor import AbstractIntegratingFactor
from jaxsat.core.checks import concrete
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft import (
    AbstractActuators,
    Actuators,
    ActuatorsWithWheels,
    WheelFailureKind,
)
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


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


NEVER = 1e9
"""s; a failure later than this has no event function that grows."""


class ContinuousLoop(AbstractContinuousLoop):
    """Plant, continuous controller and thrusters.

    `struck` tells which failures of thrusters and then of wheels have struck, see `smooth_piece`;
    None is those whose time has come. Raises `ValueError` for wheels with Coulomb friction, at
    once or after a failure, and for one that has seized and fails once more.
    """

    plant: RigidBody
    controller: AbstractController
    actuators: AbstractActuators
    struck: Bool[Array, " f"] | None = None

    def __check_init__(self):
        wheels = self.plant.wheels
        if wheels is None:
            return
        kinds = None if wheels.failures is None else concrete(wheels.failures.kind)
        rubs = kinds is not None and np.any(np.rint(kinds) == WheelFailureKind.FRICTION_TO)
        if rubs or wheels.coulomb_friction is not None:
            raise ValueError(
                "Wheels with Coulomb friction must have a command that is held, which that of a "
                "continuous controller is not."
            )
        if wheels.failures is not None and wheels.failures.frees_a_wheel():
            raise ValueError(
                "A wheel that has seized must not fail once more under a continuous controller, "
                "whose state has no jump of the momentum that the body got."
            )

    def is_smooth(self) -> bool:
        """Whether fixed steps suit the loop: no corner of the law, of actuators of a user's own or
        of wheels, whose torque ends at the limit of their momentum, and no failure in flight.

        A thruster or wheel that reaches the limit of its torque is no corner here: a smooth law
        passes it in few steps.
        """
        own = (Actuators, ActuatorsWithWheels)
        corners = 0 if isinstance(self.actuators, own) else self.actuators.event_count
        corners += self.failure_times.size + _wheel_events(self.plant)
        return not corners and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
        state = self.plant.with_wheel_momentum(state)
        return LoopState(state, self.controller.init(state))

    @property
    def torque_count(self) -> int:
        """Thrusters may turn about any axis."""
        return 3

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When something fails, s: of the actuators, then of the wheels."""
        wheels = self.plant.wheels
        of_wheels = jnp.zeros(0) if wheels is None else wheels.failure_times
        return jnp.concatenate([self.actuators.failure_times, of_wheels])

    def _struck(self, t: Float[Array, ""]) -> tuple[Bool[Array, " a"], Bool[Array, " w"]]:
        """Which failures of the actuators and of the wheels have struck."""
        times, count = self.failure_times, self.actuators.failure_times.size
        if not times.size:
            return jnp.zeros(0, bool), jnp.zeros(0, bool)
        struck = t >= times if self.struck is None else self.struck
        return struck[:count], struck[count:]

    def plant_state(self, t: Float[Array, ""], state: LoopState) -> PlantState:
        """With the wheels that have seized at rest."""
        return self.plant.after_wheel_failures(state.plant, self._struck(t)[1])

    def motion(self, t: Float[Array, ""], state: LoopState) -> Motion:
        """Equations (1) and (36) under the controller's torque."""
        plant, (thrusters, wheels) = self.plant_state(t, state), self._struck(t)
        command, memory_rate = self.controller(t, plant, state.memory)
        torque = self.actuators.after_failures(thrusters)(command)
        share = self.actuators.wheel_command(command)
        external = self._external(t, plant, torque)
        piece = self.plant.wheel_drive(plant, share, wheels, external)
        made = turns = None
        if piece is not None:
            made, turns = piece.torque(cast(Array, plant.wheel_momentum)), piece.turns
        rate = self.plant.rate(t, plant, torque, made, turns)
        relative_rate = self.plant.relative_rate(plant)
        error = self.controller.rate_error(plant)
        torque = self.plant.control_torque(torque, self.plant.made_by_wheels(rate))
        return Motion(LoopState(rate, memory_rate), plant, relative_rate, error, torque)

    def _external(self, t, plant: PlantState, torque) -> Float[Array, "3"] | None:
        """The torque of all but the wheels, N m, where the motion of rotors depends on it."""
        wheels = self.plant.wheels
        if wheels is None or wheels.rotor_inertia is None:
            return None
        return torque + self.plant.disturbance_torque(t, plant)

    def signals(self, t: Float[Array, ""], state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
        motion = self.motion(t, state)
        signals = continuous_signals(
            self.plant, self.controller, t, motion.plant, state.memory, motion.torque
        )
        made = self.plant.made_by_wheels(motion.rate.plant)
        return signals if made is None else dataclasses.replace(signals, wheel_torque=made)

    def event_functions(self, t: Float[Array, ""], state: LoopState) -> Float[Array, " m"]:
        """Those of controller, actuators and wheels' momenta, and the time since each failure."""
        plant = self.plant_state(t, state)
        command, _ = self.controller(t, plant, state.memory)
        own = self.controller.event_functions(plant)
        events = [own, self.actuators.event_functions(command)]
        if _wheel_events(self.plant):
            share, (thrusters, wheels) = self.actuators.wheel_command(command), self._struck(t)
            torque = self.actuators.after_failures(thrusters)(command)
            external = self._external(t, plant, torque)
            events.append(self.plant.wheel_events(plant, share, wheels, external))
        if self.failure_times.size:
            events.append(t - jnp.minimum(self.failure_times, NEVER))
        return jnp.concatenate(events)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ContinuousLoop":
        """Controller, actuators and wheels held in a piece of theirs each, failures as they are."""
        failures = self.failure_times.size
        signs, struck = signs[: signs.size - failures], signs[signs.size - failures :]
        wheels = signs.size - _wheel_events(self.plant)
        count = wheels - self.actuators.event_count
        held = (
            self.controller.smooth_piece(signs[:count]),
            self.actuators.smooth_piece(signs[count:wheels]),
        )
        made = eqx.tree_at(lambda loop: (loop.controller, loop.actuators), self, held)
        plant = self.plant.wheel_piece(signs[wheels:])
        return dataclasses.replace(made, plant=plant, struck=struck if failures else None)

    def integrating_factor(self, t: Float[Array, ""]) -> AbstractIntegratingFactor | None:
        """That of the controller."""
        return self.controller.integrating_factor(t)


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
        wheel_momentum=state.wheel_momentum,
    )
