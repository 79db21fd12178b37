"""Closed loops: what an integrator sees of plant, controller and actuators together.

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
        """Whether at every sample it tells the torque that actuators do not make."""
        return False

    @abc.abstractmethod
    def start(self, state: PlantState) -> PyTree:
        """The loop's state when the plant is in `state` and the controller begins."""


class Motion(NamedTuple):
    """A loop at one instant: time derivative of its state, the plant's state with its ω_r (rad/s)
    and rate error η (rad/s), and the torque of effectors on the body (N m)."""

    rate: PyTree
    plant: PlantState
    relative_rate: Vector
    rate_error: Pair
    torque: Vector


class AbstractContinuousLoop(AbstractLoop):
    """A loop that is one ordinary differential equation, smooth or in smooth pieces.

    A loop in pieces tells its event functions; with the sign of each held it is smooth.
    """

    @property
    @abc.abstractmethod
    def torque_count(self) -> int:
        """How many components of the torque, from the first on, may differ from zero."""

    @abc.abstractmethod
    def plant_state(self, t: RealScalar, state: PyTree) -> PlantState:
        """The plant in a state of the loop at time `t` (s)."""

    @abc.abstractmethod
    def motion(self, t: RealScalar, state: PyTree) -> Motion:
        """Rates and torque at one instant."""

    @abc.abstractmethod
    def signals(self, t: RealScalar, state: PyTree) -> Signals:
        """Everything worth saving at one instant."""

    @abc.abstractmethod
    def event_functions(self, t: RealScalar, state: PyTree) -> Float[Array, " m"]:
        """The event functions; the loop is smooth while none of them changes its sign."""

    @abc.abstractmethod
    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractContinuousLoop":
        """The smooth loop that this one is where its event functions have these signs."""

    @abc.abstractmethod
    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the state's `memory` at time `t` (s), if there is one."""

    def __call__(self, t: RealScalar, state: PyTree, args: None = None) -> PyTree:
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
    """The plant's body as it is once failures have struck, the command and the piece of each
    effector, and the torque (N m) that effectors do not make, see `Shares.torque_unmade`."""

    body: RigidBody
    commands: OfEach
    pieces: OfEach
    unmade: Vector | None


NEVER = 1e9
"""s; a failure later than this has no event function that grows."""


class ContinuousLoop(AbstractContinuousLoop):
    """A plant under a continuous controller.

    The `distribution` makes of a command that of each effector of the plant. `struck` says which
    failures have struck, effector by effector, see `smooth_piece`; None is those whose time has
    come. Raises `ValueError` for an effector whose command must be held.
    """

    plant: RigidBody
    controller: AbstractController
    distribution: AbstractDistribution = Direct()
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
        sharp = [one.event_count for one in self.plant.effectors if not one.mild_corners]
        return not sum(sharp) + self.failure_times.size and self.controller.is_smooth()

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
        state = self.plant.complete(state)
        return LoopState(state, self.controller.init(state))

    @property
    def torque_count(self) -> int:
        """Three: actuators may turn the body about any axis."""
        return 3

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When something fails, s: of each effector of the plant."""
        return jnp.concatenate([*self.plant.failure_times, jnp.zeros(0)])

    def _struck(self, t: RealScalar) -> Struck:
        """Which failures of each effector have struck."""
        struck = t >= self.failure_times if self.struck is None else self.struck
        sizes = [one.size for one in self.plant.failure_times]
        ends = zip(sizes, np.cumsum(sizes, dtype=int), strict=True)
        return tuple(struck[end - size : end] for size, end in ends)

    def plant_state(self, t: RealScalar, state: LoopState) -> PlantState:
        """The state of the plant, with the wheels that have seized at rest."""
        return self.plant.after_failures(state.plant, self._struck(t))

    def _acting(self, t: RealScalar, plant: PlantState, command) -> _Acting:
        """What acts on the plant at time `t` (s) on a command."""
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
        rate = body.rate(t, plant, pieces=pieces)
        relative_rate = self.plant.relative_rate(plant)
        error = self.controller.rate_error(plant)
        torque = body.control_torque(t, plant, pieces, rate.omega)
        motion = Motion(LoopState(rate, memory_rate), plant, relative_rate, error, torque)
        return motion, acting

    def signals(self, t: RealScalar, state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
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
        """Controller, distribution and effectors held in a piece of theirs each, failures as they
        are."""
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
