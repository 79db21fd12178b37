"""How effectors share in a commanded torque before all other actuators are asked."""

import abc
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.distribution import AbstractDistribution, Shares, torque_of
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField
from jaxsat.spacecraft.gimbals import ControlMomentGyros, GyroStates
from jaxsat.spacecraft.magnetorquers import Magnetorquers
from jaxsat.spacecraft.spacecraft import inverse_of
from jaxsat.spacecraft.wheels import wheel_momentum

NEARLY_SINGULAR = 0.1
"""det(A Aᵀ) of unit columns A below which rates of gimbals are damped; an even set has over 1."""

DAMPING = 0.01
"""What is added to A Aᵀ where its determinant is zero."""


class AbstractSteering(eqx.Module):
    """What one `kind` of effector makes of a law's command of three torques.

    That of an effector of a scenario has a class method `from_tables(effector, tables, context)`,
    which the declaration of the actuator names; `context` is a `SteeringContext`.
    """

    kind: ClassVar[str]
    """That of the effector of the body that is commanded."""

    @abc.abstractmethod
    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """The command of each at time `t` (s), and what of a torque (N m) is left to others.

        `state` is what the law is told of the plant.
        """

    def within_reach(self, t: RealScalar, state: PlantState, torque: Vector) -> Vector:
        """The part of a torque (N m) that the kind would make if it had no limits."""
        del t, state
        return torque


class SteeringContext(NamedTuple):
    """What a scenario tells a steering besides its effector and the tables of that.

    `left` (3, 3) is the part of a command of three torques that wheels do not make. Wheels along
    unit `wheel_axes`, zero for those that have failed, are to lose what momentum they have beyond
    the `bias` (N m s, body axes) in parts of `unloading` a second.
    """

    wheel_axes: Float[np.ndarray, "3 wheels"] | None
    left: Float[np.ndarray, "3 3"]
    unloading: float
    bias: Float[np.ndarray, "3"]


class Steered(AbstractDistribution):
    """Effectors that share in a torque by a `steering` of their own, in its order, then others.

    What steering leaves of the command goes to the other effectors as `rest` shares it; with None
    it stays unmade. What is out of reach at any limits, such as a torque of magnetorquers along the
    field that no wheel makes, does not count as unmade.
    """

    steering: tuple[AbstractSteering, ...] = ()
    rest: AbstractDistribution | None = None

    def __call__(self, t, state, command, effectors) -> Shares:
        """What each effector is asked for; raises `ValueError` for a steering without its own."""
        steered, beyond = {}, command
        for one in self.steering:
            beyond = beyond - one.within_reach(t, state, beyond)
            steered[one.kind], command = one(t, state, command)
        kinds = [one.kind for one in effectors]
        for kind in steered:
            if kind not in kinds:
                raise ArgumentError("steering", f"must be of effectors among {kinds}", kind)
        others = tuple(one for one in effectors if one.kind not in steered)
        if self.rest is None:
            shares = Shares(tuple(one.idle() for one in others), torque_of(command))
        else:
            shares = self.rest(t, state, command, others)
            beyond = self.rest.out_of_reach(beyond, others)
        left = None if shares.left is None else shares.left - torque_of(beyond)
        queue = iter(shares.uses)
        uses = tuple(steered[kind] if kind in steered else next(queue) for kind in kinds)
        return Shares(uses, left)

    def tells_left(self, effectors) -> bool:
        """Whether `Shares.left` is told: that of steering alone is, else the rest says so."""
        return self.rest is None or self.rest.tells_left(effectors)


class MagneticSteering(AbstractSteering):
    """Dipoles m = B × τ / |B|², which make of a wanted torque τ what is across the field B.

    τ = `wanted` u - `unloading` (A h - h0): a part of the law's command u (N m), and what takes
    momentum h beyond the `bias` h0 (N m s) out of the wheels along `wheel_axes` A, in parts a
    second. `shares` (k, 3) makes a dipole of the magnetorquers along `axes`. Of all dipoles with
    the same torque these have the least sum of squares over the `dipole_limit` (A m²) of each,
    within the limits; of a torque that cannot be made, the greatest part is. What they then make is
    left out of the command of all other actuators, so that the body feels the law's torque. B is
    that of the `field` at the attitude that the law is told. Sidi, Spacecraft Dynamics and Control,
    1997, sections 7.4 and 7.5: the cross-product law.
    """

    kind: ClassVar[str] = Magnetorquers.kind

    field: AbstractMagneticField
    axes: Float[Array, "3 k"] = eqx.field(converter=as_float)
    shares: Float[Array, "k 3"] = eqx.field(converter=as_float)
    dipole_limit: Float[Array, " k"] = eqx.field(converter=as_float)
    wanted: Matrix = eqx.field(converter=as_float)
    unloading: RealScalar = eqx.field(converter=as_float, default=0.0)
    wheel_axes: Float[Array, "3 wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    bias: Vector = eqx.field(converter=as_float, default=(0.0, 0.0, 0.0))

    @classmethod
    def from_tables(
        cls, effector: Magnetorquers, tables: Sequence[Any], context: SteeringContext
    ) -> "MagneticSteering":
        """Dipoles for what wheels do not make of a command of three torques, and that unload them.

        Those that have failed before the start are asked for nothing.
        """
        axes, working = np.asarray(effector.axes), [not one.failed for one in tables]
        shares = np.zeros((axes.shape[1], 3))
        shares[working] = np.linalg.pinv(axes[:, working])
        limit, (wheels, left, unloading, bias) = effector.dipole_limit, context
        return cls(effector.field, axes, shares, limit, left, unloading, wheels, bias)

    def __check_init__(self):
        require_positive("dipole_limit", self.dipole_limit)
        require_positive("unloading", self.unloading, zero_allowed=True)

    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """The dipole of each magnetorquer (A m²), and the command left to others (N m)."""
        field = self.field.in_body(t, state.attitude)
        dipoles, torque = self.within_limits(field, self.wanted_torque(state, command))
        return dipoles, command - torque

    def within_limits(self, field: Vector, torque: Vector) -> tuple[Float[Array, " k"], Vector]:
        """The dipole of each (A m²) for a torque (N m) in a field (T, body axes), and what they
        make of it."""
        reach = self.reach(field)
        dipoles = allocate(reach, reach.columns @ self.unlimited(field, torque)).use
        return dipoles, reach.columns @ dipoles

    def reach(self, field: Vector) -> Reach:
        """What the dipole of each (A m²) makes in a field (T, body axes), within its limit."""
        limit = jnp.where(jnp.any(self.shares != 0, axis=1), self.dipole_limit, 0.0)
        return Reach(jnp.cross(self.axes, field[:, None], axis=0), -limit, limit)

    def within_reach(self, t: RealScalar, state: PlantState, torque: Vector) -> Vector:
        """What dipoles make that have no limits (N m): none of it is along the field."""
        field = self.field.in_body(t, state.attitude)
        across = jnp.cross(self.axes, field[:, None], axis=0)
        return across @ self.unlimited(field, self.wanted_torque(state, torque))

    def wanted_torque(self, state: PlantState, command: Vector) -> Vector:
        """The torque (N m) that dipoles are to make for a command of the law (N m)."""
        return self.wanted @ command - self.unloading * self.excess(state)

    def unlimited(self, field: Vector, torque: Vector) -> Float[Array, " k"]:
        """The dipole of each (A m²) for a torque in a field (T, body axes) if it had no limit."""
        return self.shares @ (jnp.cross(field, torque) / jnp.sum(field**2))

    def excess(self, state: PlantState) -> Vector:
        """Momentum of the wheels beyond their bias, N m s, in body axes."""
        momentum = wheel_momentum(state)
        if self.wheel_axes is None or momentum is None:
            return jnp.zeros_like(state.omega)
        return self.wheel_axes @ momentum - self.bias


class GimbalSteering(AbstractSteering):
    """Rates of gimbals that make a torque: A dδ/dt = τ, with A the columns of their reach.

    τ is the law's command and ω × h, which cancels what the momentum h of the `gyros` does to a
    body that turns. Rates are least squares within the limits of the gimbals; of a torque that they
    cannot make, the greatest part is. Near a singular set of angles, where no rate makes a torque
    about some axis, they are those of the singularity-robust inverse Aᵀ (A Aᵀ + λ 1)⁻¹, in which λ
    grows from zero (Nakamura and Hanafusa, J. Dynamic Systems, Measurement and Control 108, 1986).
    No rates are added that make no torque, so that angles may come to a singular set and stay.
    `working` is 1 for each gyro that is commanded, 0 for others. What gyros do not make is left.
    """

    kind: ClassVar[str] = ControlMomentGyros.kind

    gyros: ControlMomentGyros
    working: Float[Array, " k"] = eqx.field(converter=as_float)

    @classmethod
    def from_tables(
        cls, effector: ControlMomentGyros, tables: Sequence[Any], context: SteeringContext
    ) -> "GimbalSteering":
        """The steering of the gyros that have not failed before the start."""
        working = np.array([not one.failed for one in tables], float)
        return cls(cast(ControlMomentGyros, effector.without_corners()), working)

    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """The rate of each gimbal (rad/s), and the command left to others (N m)."""
        own = state.find(GyroStates)
        if own is None:
            raise ValueError("Argument `state` must have the states of gyros, but has none.")
        sound = jnp.zeros(self.gyros.failure_times.shape, bool)
        reach = self.gyros.reach(t, state, own, sound, jnp.zeros_like(t))
        reach = reach._replace(low=reach.low * self.working, high=reach.high * self.working)
        torque = command + jnp.cross(state.omega, self.gyros.momentum(own))
        size = jnp.sqrt(jnp.sum((reach.columns * self.working[None]) ** 2, axis=0))
        units = reach.columns / jnp.where(size > 0, size, jnp.inf)[None]
        rates = allocate(reach, units @ _robust(units, torque)).use
        return rates, torque - reach.columns @ rates


def _robust(columns: Float[Array, "3 k"], torque: Vector) -> Float[Array, " k"]:
    """Uses of unit columns that make a torque (N m), damped where the columns lack a direction."""
    square = columns @ columns.T
    determinant = jnp.dot(square[0], jnp.cross(square[1], square[2]))
    lack = jnp.maximum(1 - determinant / NEARLY_SINGULAR, 0.0)
    return columns.T @ (inverse_of(square + DAMPING * lack**2 * jnp.eye(3)) @ torque)
