"""Interface of controllers, the context of their construction, and the base of backstepping laws.

A controller maps time, the measured plant state and its own memory to a commanded torque (u1, u2)
about the first two body axes, or to a torque about each of the three. Continuous controllers also
return the rate of their memory; sampled ones (`jaxsat.control.switching`) its next value instead.
"""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.control.diagnosis.thruster_filter import ThrusterModel
from jaxsat.core.array_types import Pair, RealScalar
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.laws import COAST
from jaxsat.core.errors import JaxsatError
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.magnetorquers import MagneticSteering
from jaxsat.spacecraft.wheels import Wheels


class ThrusterContext(NamedTuple):
    """Thruster data of a law that commands duties.

    `cost` is the cost of each at full thrust, `rate_noise` (rad/s) the standard deviation of the
    measured rates, zero where they are exact. `pulse` (s) is the smallest on-time, of which each
    thruster gives whole multiples, zero for any on-time.
    """

    model: ThrusterModel
    cost: Float[np.ndarray, " m"]
    rate_noise: float
    pulse: Float[np.ndarray, " m"]


class WheelContext(NamedTuple):
    """Wheel data of a law that commands the torque of each wheel.

    `wheels` have the declared limits and friction, and no failures in flight. `failed` marks those
    that had failed before the start. `momentum_noise` (N m s) is the standard deviation of each
    tachometer, `rate_noise` (rad/s) that of the measured rates, zero where they are exact. `still`
    is whether no wheel has momentum at the start.
    """

    wheels: Wheels
    failed: Bool[np.ndarray, " m"]
    momentum_noise: Float[np.ndarray, " m"]
    rate_noise: float = 0.0
    still: bool = True


class MagneticContext(NamedTuple):
    """Data of the magnetorquers that act together with wheels, if any.

    `steering` converts the law's torque to dipoles, and `momentum` (N m s, body axes) is that of
    the wheels at their bias, and of those that have failed at the start.
    """

    steering: MagneticSteering
    momentum: Float[np.ndarray, "3"]


class LawContext(NamedTuple):
    """Data from a scenario for the construction of a law, besides the law's own keys.

    `model` is the controller's model of the plant, with the measured disturbance. Its inertia
    excludes the wheels' rotor inertia about their spin axes. `torque_limit` (N m) is that of each
    thruster, None if unlimited. The periodic disturbance has `disturbance_amplitude` (N m) and
    `disturbance_frequency` (rad/s) about x, y and z. The unit columns of `torque_axes` are the
    torque axes of the working thrusters. `thrusters` is None except for laws that command duties,
    `wheels` except for laws that command the torque of each wheel. The unit columns of `wheel_axes`
    are those of all wheels, None without wheels. `gravity_gradient` is true if that torque acts.
    `magnetic` is None without working magnetorquers. `rate_noise` (rad/s) is the standard deviation
    of the measured rates. Commands act `delay` (s) late.
    """

    model: RigidBody
    torque_limit: float | None
    disturbance_amplitude: tuple[float, ...]
    disturbance_frequency: tuple[float, ...]
    torque_axes: Float[np.ndarray, "3 m"] = np.eye(3)[:, :2]
    thrusters: ThrusterContext | None = None
    wheels: WheelContext | None = None
    gravity_gradient: bool = False
    wheel_axes: Float[np.ndarray, "3 wheels"] | None = None
    magnetic: MagneticContext | None = None
    rate_noise: float = 0.0
    delay: float = 0.0


Believed = Literal["inertia", "orbit_rate", "inclination"]


class UnsuitableModel(JaxsatError, ValueError):
    """A law cannot be constructed for its model of `about`, the inertia or the orbit."""

    about: Believed

    def __init__(self, about: Believed, message: str):
        super().__init__(message)
        self.about = about


Memory = PyTree
"""State of a controller, of any structure."""


class AbstractIntegratingFactor(eqx.Module):
    """The integrating factor e^(At) at one instant, of a memory with d/dt memory = A memory + b.

    In the *rotating frame*, e^(-At) memory, the memory changes by b alone: A, above all its
    oscillations, does not limit the integrator's steps.
    """

    @abc.abstractmethod
    def into_frame(self, memory: PyTree) -> PyTree:
        """e^(-At) memory."""

    @abc.abstractmethod
    def out_of_frame(self, framed: PyTree) -> PyTree:
        """Inverse of `into_frame`."""

    @abc.abstractmethod
    def rate_in_frame(self, rate_error: Pair) -> PyTree:
        """e^(-At) b, the time derivative of e^(-At) memory, at a rate error of the law, rad/s."""


class AbstractController(eqx.Module):
    """A continuous controller."""

    @abc.abstractmethod
    def init(self, state: PlantState) -> Memory:
        """The memory at the start."""

    @abc.abstractmethod
    def __call__(
        self, t: RealScalar, state: PlantState, memory: Memory
    ) -> tuple[Float[Array, " torques"], Memory]:
        """The commanded torque, N m, and the time derivative of the memory."""

    def is_smooth(self) -> bool:
        """Whether the law has no corner or jump, so that fixed steps suit it; not for tracing."""
        return True

    def event_functions(self, state: PlantState) -> Float[Array, " m"]:
        """Event functions: the law is smooth while none changes its sign; here, none."""
        return jnp.zeros(0, state.omega.dtype)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractController":
        """The smooth law that equals this one where its event functions have these signs.

        It is also evaluated slightly beyond that region, where it continues smoothly.
        """
        return self

    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the memory at time `t` (s), if known; here, None."""

    def rate_error(self, state: PlantState) -> Pair:
        """Rate error η_i = ω_i - ω_id, rad/s; here NaN, for none."""
        return jnp.full(2, jnp.nan, state.omega.dtype)

    def lyapunov(
        self, state: PlantState, memory: Memory, unmodelled: Pair, unmodelled_rate: Pair
    ) -> RealScalar:
        """The Lyapunov function of the law's stability proof; here NaN, for none.

        `unmodelled` is the disturbance about the first two axes that the controller's model lacks,
        N m, and `unmodelled_rate` its time derivative.
        """
        return jnp.full((), jnp.nan, state.omega.dtype)


class AbstractFeedbackLaw(AbstractController):
    """A smooth law without a memory: the torque is a function of time and state alone."""

    @abc.abstractmethod
    def torque(self, t: RealScalar, state: PlantState) -> Float[Array, " torques"]:
        """The commanded torque, N m: (u1, u2), or one about each body axis."""

    def init(self, state: PlantState) -> Memory:
        """The memory at the start: a feedback law has none."""
        return None

    def __call__(
        self, t: RealScalar, state: PlantState, memory: Memory
    ) -> tuple[Float[Array, " torques"], Memory]:
        """The torque at this instant."""
        return self.torque(t, state), memory


class Coast(AbstractFeedbackLaw):
    """No control: the drift of the plant alone."""

    declaration: ClassVar[LawDeclaration] = COAST

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "Coast":
        """The law from a scenario's table, which has no keys."""
        return cls()

    def torque(self, t: RealScalar, state: PlantState) -> Pair:
        """Zero torque."""
        return jnp.zeros(2, state.omega.dtype)


class AbstractBacksteppingLaw(AbstractController):
    """A law that makes ω1 and ω2 track a reference which steers everything else.

    The torques (39) and (42) have one form: a feedback on the rate error, minus the gyroscopic
    torque, minus the modelled disturbance, plus J dω_d/dt, the derivative taken along the
    controller's own model. If model and plant are equal, the rate error obeys J dη/dt = feedback +
    unmodelled disturbance, equation (43).
    """

    model: eqx.AbstractVar[RigidBody]

    @abc.abstractmethod
    def reference_rate(self, state: PlantState) -> Pair:
        """The intermediate control law: the rates (ω1, ω2) to track, rad/s."""

    @abc.abstractmethod
    def feedback(self, state: PlantState, rate_error: Pair, memory: Memory) -> Pair:
        """The torque that drives the rate error to zero, N m."""

    @abc.abstractmethod
    def memory_rate(self, rate_error: Pair, memory: Memory) -> Memory:
        """Time derivative of the memory."""

    def rate_error(self, state: PlantState) -> Pair:
        """η_i = ω_i - ω_id, rad/s."""
        return state.omega[:2] - self.reference_rate(state)

    def reference_and_derivative(self, t: RealScalar, state: PlantState) -> tuple[Pair, Pair]:
        """ω_d (rad/s) and dω_d/dt along the controller's own model (rad/s²)."""
        model_rate = self.model.rate(t, state, jnp.zeros_like(state.omega))
        return jax.jvp(self.reference_rate, (state,), (model_rate,))

    def torque(
        self, t: RealScalar, state: PlantState, memory: Memory, reference_derivative: Pair
    ) -> Pair:
        """Equations (39) and (42) with a given dω_d/dt, N m."""
        feedback = self.feedback(state, self.rate_error(state), memory)
        return self.torque_of(t, state, feedback, reference_derivative)

    def torque_of(
        self, t: RealScalar, state: PlantState, feedback: Pair, reference_derivative: Pair
    ) -> Pair:
        """The torque of (39) and (42) for a feedback (N m) and dω_d/dt, N m."""
        j1, j2, j3 = self.model.spacecraft.moments
        omega1, omega2, omega3 = state.omega
        gyroscopic = jnp.stack([(j2 - j3) * omega2 * omega3, (j3 - j1) * omega3 * omega1])
        disturbance = self.model.disturbance_torque(t, state)[:2]
        return feedback - gyroscopic - disturbance + jnp.stack([j1, j2]) * reference_derivative

    def __call__(self, t: RealScalar, state: PlantState, memory: Memory) -> tuple[Pair, Memory]:
        """The torque and the rate of the memory."""
        reference, derivative = self.reference_and_derivative(t, state)
        error = state.omega[:2] - reference
        command = self.torque_of(t, state, self.feedback(state, error, memory), derivative)
        return command, self.memory_rate(error, memory)
