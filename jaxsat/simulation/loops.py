"""Closed loops: what an integrator sees of plant, controller and actuators together.

Three forms of the same thing. `ContinuousLoop` is the direct one. `ErrorCoordinateLoop` replaces
ω1 and ω2 by the rate error η, in which the printed three-axis law has no jumps. `SampledLoop`
runs a sampled controller and holds its torque in between.
"""

import abc
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, PyTree

from jaxsat.attitude import AbstractAttitude
from jaxsat.checks import as_float, concrete, require_positive
from jaxsat.control import AbstractBacksteppingLaw, AbstractController, AbstractSampledController
from jaxsat.control.controller import Memory
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.simulation.trajectory import Signals
from jaxsat.vehicle import Actuators, Sensors


class AbstractLoop(eqx.Module):
    """A plant under control."""

    plant: eqx.AbstractVar[RigidBody]

    @abc.abstractmethod
    def start(self, state: PlantState) -> PyTree:
        """The loop's state when the plant is in `state` and the controller begins."""


class AbstractContinuousLoop(AbstractLoop):
    """A loop that is one ordinary differential equation."""

    @abc.abstractmethod
    def __call__(self, t: Float[Array, ""], state: PyTree, args: None) -> PyTree:
        """Time derivative of the loop's state, in the form diffrax integrates."""

    @abc.abstractmethod
    def signals(self, t: Float[Array, ""], state: PyTree) -> Signals:
        """Everything worth saving at one instant."""


class LoopState(NamedTuple):
    """State of the plant and memory of its controller."""

    plant: PlantState
    memory: Memory


class ContinuousLoop(AbstractContinuousLoop):
    """Plant, continuous controller and thrusters."""

    plant: RigidBody
    controller: AbstractController
    actuators: Actuators

    def start(self, state: PlantState) -> LoopState:
        """The plant's state and the controller's first memory."""
        return LoopState(state, self.controller.init(state))

    def __call__(self, t: Float[Array, ""], state: LoopState, args: None = None) -> LoopState:
        """Equations (1) and (36) under the controller's torque."""
        command, memory_rate = self.controller(t, state.plant, state.memory)
        return LoopState(self.plant.rate(t, state.plant, self.actuators(command)), memory_rate)

    def signals(self, t: Float[Array, ""], state: LoopState) -> Signals:
        """Everything worth saving at one instant."""
        command, _ = self.controller(t, state.plant, state.memory)
        return _signals(
            self.plant, self.controller, t, state.plant, state.memory, self.actuators(command)
        )


class ErrorState(NamedTuple):
    """Attitude, third rate (rad/s), rate error η (rad/s) and memory."""

    attitude: AbstractAttitude
    omega3: Float[Array, ""]
    rate_error: Float[Array, "2"]
    memory: Memory


class ErrorCoordinateLoop(AbstractContinuousLoop):
    """The loop of (43): a backstepping law whose model is the plant, in error coordinates.

    With unlimited torques about body x and y and the same inertia and orbit in law and plant, the
    derivative of the reference cancels, so no derivative of sat appears and the loop is Lipschitz
    away from w = 0. Only a disturbance of ω3 that the law does not know brings it back, through
    the dependence of the reference on ω3. Raises `ValueError` where law and plant differ.
    """

    plant: RigidBody
    law: AbstractBacksteppingLaw

    def __check_init__(self):
        known = [concrete(x) for x in jax.tree.leaves((self.plant, self.law))]
        if any(leaf is None for leaf in known):
            return
        believed, true = self.law.model, self.plant
        same_body = np.array_equal(believed.spacecraft.inertia, true.spacecraft.inertia)
        same_orbit = bool(eqx.tree_equal(believed.orbit, true.orbit))
        inertia = np.asarray(true.spacecraft.inertia)
        principal = np.array_equal(inertia, np.diag(np.diag(inertia)))
        if not (same_body and same_orbit and principal):
            raise ValueError(
                "Error coordinates must have principal body axes and the same inertia and orbit "
                "in law and plant; simulate this loop at torque level instead."
            )
        if believed.third_rate_held != true.third_rate_held:
            raise ValueError("Law and plant must agree on whether the third rate is held.")

    def start(self, state: PlantState) -> ErrorState:
        """The rates turned into rate errors."""
        error, memory = self.law.rate_error(state), self.law.init(state)
        return ErrorState(state.attitude, state.omega[2], error, memory)

    def plant_state(self, state: ErrorState) -> PlantState:
        """The rate errors turned back into rates."""
        zero = jnp.zeros_like(state.omega3)
        probe = PlantState(state.attitude, jnp.stack([zero, zero, state.omega3]))
        omega1, omega2 = self.law.reference_rate(probe) + state.rate_error
        return PlantState(state.attitude, jnp.stack([omega1, omega2, state.omega3]))

    def __call__(self, t: Float[Array, ""], state: ErrorState, args: None = None) -> ErrorState:
        """Equations (36) and (43), with (37) for ω3."""
        plant_state = self.plant_state(state)
        inertia1, inertia2, inertia3 = self.plant.spacecraft.moments
        unmodelled = self._unmodelled(t, plant_state)
        feedback = self.law.feedback(plant_state, state.rate_error, state.memory)
        error_rate = (feedback + unmodelled[:2]) / jnp.stack([inertia1, inertia2])
        omega3_rate = jnp.zeros_like(state.omega3)
        if not self.plant.third_rate_held:
            disturbance = self.plant.disturbance_torque(t, plant_state)
            omega3_rate = self.plant.angular_acceleration(plant_state.omega, disturbance)[2]
            sensitivity = self._reference_by_omega3(plant_state)
            error_rate = error_rate - sensitivity * unmodelled[2] / inertia3
        return ErrorState(
            state.attitude.rate(self.plant.relative_rate(plant_state)),
            omega3_rate,
            error_rate,
            self.law.memory_rate(state.rate_error, state.memory),
        )

    def signals(self, t: Float[Array, ""], state: ErrorState) -> Signals:
        """Everything worth saving at one instant, the torque by (39) or (42)."""
        plant_state = self.plant_state(state)
        command, _ = self.law(t, plant_state, state.memory)
        torque = jnp.concatenate([command, jnp.zeros_like(command[:1])])
        return _signals(self.plant, self.law, t, plant_state, state.memory, torque)

    def _unmodelled(self, t: Float[Array, ""], state: PlantState) -> Float[Array, "3"]:
        return self.plant.disturbance_torque(t, state) - self.law.model.disturbance_torque(t, state)

    def _reference_by_omega3(self, state: PlantState) -> Float[Array, "2"]:
        unit = PlantState(
            jax.tree.map(jnp.zeros_like, state.attitude), jnp.zeros_like(state.omega).at[2].set(1.0)
        )
        return jax.jvp(self.law.reference_rate, (state,), (unit,))[1]


def _as_delay(value: ArrayLike | None) -> Float[Array, ""] | None:
    return None if value is None else as_float(value)


class SampledState(NamedTuple):
    """State of the plant, memory of its controller, and the torque (N m) now being made."""

    plant: PlantState
    memory: Memory
    torque: Float[Array, "3"]


class Hold(NamedTuple):
    """A time during which the torque (N m) stays: `begin` and `length` in s, from the sample on."""

    begin: Float[Array, ""]
    length: Float[Array, ""]
    torque: Float[Array, "3"]


class SampledLoop(AbstractLoop):
    """Plant and thrusters under a sampled controller whose torque is held between samples.

    The plant is integrated over each period in `substeps` equal steps. `sensors` stand between the
    true state and what the controller is told; None tells it the truth. A `delay` (s, at most one
    period) is the time the controller takes to compute: for so long after each sample the
    thrusters go on with what they did; None is a loop without. Each part of a delayed period is
    integrated in `substeps` steps of its own.
    """

    plant: RigidBody
    controller: AbstractSampledController
    actuators: Actuators
    substeps: int = eqx.field(static=True, default=4)
    sensors: Sensors | None = None
    delay: Float[Array, ""] | None = eqx.field(converter=_as_delay, default=None)

    def __check_init__(self):
        if self.substeps < 1:
            raise ValueError(f"Argument `substeps` must be at least 1, but got {self.substeps}.")
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
        measured = self.measured(jnp.array(0), state)
        return SampledState(state, self.controller.init(measured), jnp.zeros_like(state.omega))

    def measured(self, number: Int[Array, ""], state: PlantState) -> PlantState:
        """What the controller is told at sample `number` of the run when the truth is `state`."""
        if self.sensors is None:
            return state
        return PlantState(*self.sensors(number, state.attitude, state.omega))

    def sample(
        self, number: Int[Array, ""], t: Float[Array, ""], state: SampledState
    ) -> tuple[Float[Array, "3"], Memory, Signals]:
        """One run of the controller, sample `number` of the run at time `t` (s).

        Gives the torque that follows from it (N m), its next memory, and the signals of the truth
        at this instant.
        """
        command, memory = self.controller.step(t, self.measured(number, state.plant), state.memory)
        torque = self.actuators(command)
        acting = torque
        if self.delay is not None:
            acting = jnp.where(self.delay > 0, state.torque, torque)
        return torque, memory, _sampled_signals(self, t, state.plant, memory, acting)

    def holds(self, state: SampledState, torque: Float[Array, "3"]) -> tuple[Hold, ...]:
        """The parts of a period that begins in `state` and whose sample asked for `torque`."""
        period = self.controller.period
        if self.delay is None:
            return (Hold(jnp.zeros_like(period), period, torque),)
        return (
            Hold(jnp.zeros_like(period), self.delay, state.torque),
            Hold(self.delay, period - self.delay, torque),
        )

    def plant_rate(
        self, t: Float[Array, ""], state: PlantState, torque: Float[Array, "3"]
    ) -> PlantState:
        """The plant under a held torque, in the form diffrax integrates."""
        return self.plant.rate(t, state, torque)


def _signals(plant, controller, t, state, memory, torque) -> Signals:
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
    )
