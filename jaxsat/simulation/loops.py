"""Closed loops: plant, controller and actuators as one system for an integrator.

`ContinuousLoop` is the direct form; `jaxsat.simulation.error_coordinates` has another, in which the
printed three-axis law has no jumps, and `jaxsat.simulation.sampled_loop` one that runs a sampled
controller.
"""

import abc
import dataclasses
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control.controller import (
    AbstractBacksteppingLaw,
    AbstractController,
    AbstractIntegratingFactor,
    Memory,
)
from jaxsat.core.array_types import Pair, RealScalar, Vector
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft.distribution import AbstractDistribution, Direct
from jaxsat.spacecraft.dynamics import OfEach, PlantState, RigidBody, Struck
from jaxsat.spacecraft.failures import AbstractFailures


class AbstractLoop(eqx.Module):
    """A plant under control."""

    plant: eqx.AbstractVar[RigidBody]

    @property
    def tells_unmade(self) -> bool:
        """Whether every sample includes the torque that the actuators do not make."""
        return False

    @abc.abstractmethod
    def start(self, state: PlantState) -> PyTree:
        """The loop's state when the plant is in `state` and the controller starts."""


class Motion(NamedTuple):
    """A loop at one instant: time derivative of its state, the plant's state with its ω_r (rad/s)
    and rate error η (rad/s), and the torque of effectors on the body (N m)."""

    rate: PyTree
    plant: PlantState
    relative_rate: Vector
    rate_error: Pair
    torque: Vector


class AbstractContinuousLoop(AbstractLoop):
    """A loop that is one ordinary differential equation, smooth or piecewise smooth.

    A piecewise smooth loop has event functions; with the sign of each fixed it is smooth.
    """

    @property
    @abc.abstractmethod
    def torque_count(self) -> int:
        """Number of leading torque components that may be nonzero."""

    @abc.abstractmethod
    def plant_state(self, t: RealScalar, state: PyTree) -> PlantState:
        """The plant in a state of the loop at time `t` (s)."""

    @abc.abstractmethod
    def motion(self, t: RealScalar, state: PyTree) -> Motion:
        """Rates and torque at one instant."""

    @abc.abstractmethod
    def signals(self, t: RealScalar, state: PyTree) -> Signals:
        """All signals at one instant."""

    @abc.abstractmethod
    def event_functions(self, t: RealScalar, state: PyTree) -> Float[Array, " m"]:
        """The event functions; the loop is smooth while none of them changes its sign."""

    @abc.abstractmethod
    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractContinuousLoop":
        """The smooth loop that equals this one where its event functions have these signs."""

    @abc.abstractmethod
    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the state's `memory` at time `t` (s), or None."""

    def __call__(self, t: RealScalar, state: PyTree, args: None = None) -> PyTree:
        """Time derivative of the loop's state, in the form diffrax integrates."""
        return self.motion(t, state).rate


class LoopState(NamedTuple):
    """State of the plant, as if no wheel had seized, and memory of its controller.

    A seizing wheel gives its momentum to the body at once. So that no integrated variable jumps,
    `plant` retains the wheel's momentum at seizure; `ContinuousLoop.plant_state` returns the state
    of the plant.
    """

    plant: PlantState
    memory: Memory


class _Acting(NamedTuple):
    """The plant's body after failures, the command and the piece of each effector, and the torque
    (N m) that effectors do not produce, see `Shares.torque_unmade`."""

    body: RigidBody
    commands: OfEach
    pieces: OfEach
    unmade: Vector | None


NEVER = 1e9
"""Largest failure time, s, in event functions: later and infinite times are clipped to it."""


class ContinuousLoop(AbstractContinuousLoop):
    """A plant under a continuous controller.

    The `distribution` divides a command among the plant's effectors. `struck` marks the failures
    that have occurred, effector by effector, see `smooth_piece`; with None they follow from the
    time. Raises `ValueError` for an effector whose command must be held.
    """

    plant: RigidBody
    controller: AbstractController
    distribution: AbstractDistribution = Direct()
    struck: Bool[Array, " f"] | None = None

    def __check_init__(self):
        for one in self.plant.effectors:
            one.require_continuous()

    def is_smooth(self) -> bool:
        """Whether fixed steps suit the loop: the law, a user's own actuators and wheels (whose
        torque ends at their momentum limit) have no corner, and nothing fails in flight.

        The torque limit of a thruster or wheel is no corner here: a smooth law passes it in few
        steps.
        """
        sharp = [one.event_count for one in self.plant.effectors if not one.mild_corners]
        failures = jax.eval_shape(lambda: self.failure_times).size  # XLA compiles nothing for it
        return not sum(sharp) + failures and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's initial memory."""
        state = self.plant.complete(state)
        return LoopState(state, self.controller.init(state))

    @property
    def torque_count(self) -> int:
        """Number of torque components: 3, as actuators may turn the body about any axis."""
        return 3

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """Failure times, s, effector by effector."""
        return jnp.concatenate([*self.plant.failure_times, jnp.zeros(0)])

    def _struck(self, t: RealScalar) -> Struck:
        """Whether each failure has occurred, by effector."""
        struck = t >= self.failure_times if self.struck is None else self.struck
        sizes = [one.size for one in self.plant.failure_times]
        ends = zip(sizes, np.cumsum(sizes, dtype=int), strict=True)
        return tuple(struck[end - size : end] for size, end in ends)

    def plant_state(self, t: RealScalar, state: LoopState) -> PlantState:
        """The state of the plant, with seized wheels at rest."""
        return self.plant.after_failures(state.plant, self._struck(t))

    def _acting(self, t: RealScalar, plant: PlantState, command) -> _Acting:
        """Body, commands and pieces that act on the plant at time `t` (s) under a command."""
        effectors = self.plant.effectors
        shares = self.distribution(t, plant, command, effectors)
        body, commands = self.plant.driven(plant, shares.uses, self._struck(t))
        pieces = body.pieces(body.modes(t, plant, commands), commands)
        return _Acting(body, commands, pieces, shares.torque_unmade(effectors))

    def motion(self, t: RealScalar, state: LoopState) -> Motion:
        """Equations (1) and (36) under the controller's torque."""
        return self._motion(t, state)[0]

    def _motion(self, t: RealScalar, state: LoopState) -> tuple[Motion, _Acting]:
        plant = self.plant_state(t, state)
        command, memory_rate = self.controller(t, plant, state.memory)
        acting = self._acting(t, plant, command)
        body, pieces = acting.body, acting.pieces
        rate, relative_rate, torque = body.motion(t, plant, pieces=pieces)
        error = self.controller.rate_error(plant)
        motion = Motion(LoopState(rate, memory_rate), plant, relative_rate, error, torque)
        return motion, acting

    def signals(self, t: RealScalar, state: LoopState) -> Signals:
        """All signals at one instant."""
        motion, acting = self._motion(t, state)
        signals = continuous_signals(
            self.plant, self.controller, t, motion.plant, state.memory, motion.torque
        )
        parts = acting.body.signals(motion.plant, acting.pieces, motion.rate.plant.omega)
        return dataclasses.replace(signals, torque_unmade=acting.unmade).with_parts(parts)

    def event_functions(self, t: RealScalar, state: LoopState) -> Float[Array, " m"]:
        """Event functions of controller, distribution and effectors, and times since failures."""
        plant = self.plant_state(t, state)
        command, _ = self.controller(t, plant, state.memory)
        own = self.controller.event_functions(plant)
        events = [own, self.distribution.event_functions(command)]
        if self.plant.event_count:
            body, commands, pieces, _ = self._acting(t, plant, command)
            acceleration = body.acceleration(t, plant, pieces=pieces)
            events.append(body.event_functions(plant, commands, acceleration))
        if self.failure_times.size:
            events.append(t - jnp.minimum(self.failure_times, NEVER))
        return jnp.concatenate(events)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ContinuousLoop":
        """The loop with controller, distribution and effectors each fixed to a smooth piece."""
        failures, effectors = self.failure_times.size, self.plant.event_count
        signs, struck = signs[: signs.size - failures], signs[signs.size - failures :]
        own = signs.size - effectors - self.distribution.event_count
        law, shares, others = jnp.split(signs, [own, signs.size - effectors])
        return ContinuousLoop(
            self.plant.smooth_piece(others),
            self.controller.smooth_piece(law),
            self.distribution.smooth_piece(shares),
            struck if failures else None,
        )

    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the controller."""
        return self.controller.integrating_factor(t)


def continuous_signals(plant, controller, t, state, memory, torque) -> Signals:
    """The signals of a continuous controller that requests a torque (N m) at time `t` (s)."""

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
    """The signals common to all loops, of a plant in `state` under a torque (N m)."""
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
        parts=plant.stored(state),
    )


Part = TypeVar("Part")


def parts_of(kind: type[Part], tree: PyTree) -> list[Part]:
    """All parts of one kind in a module."""
    parts = jax.tree.leaves(tree, is_leaf=lambda part: isinstance(part, kind))
    return [part for part in parts if isinstance(part, kind)]


def failures_of(loop: AbstractLoop) -> list[AbstractFailures]:
    """The failures in flight of a loop, effector by effector."""
    return parts_of(AbstractFailures, loop.plant.effectors)


def sensor_failures_of(loop: AbstractLoop) -> list[AbstractFailures]:
    """The failures in flight of the sensors of a loop: attitude sensors, gyro, tachometers."""
    navigation, tachometers = (getattr(loop, name, None) for name in ("navigation", "tachometers"))
    sensors = [navigation, getattr(navigation, "gyro", None), tachometers]
    failures = [getattr(one, "failures", None) for one in sensors]
    return [one for one in failures if isinstance(one, AbstractFailures)]
