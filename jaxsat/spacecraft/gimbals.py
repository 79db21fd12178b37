"""Single-gimbal control moment gyros: rotors of constant momentum that gimbals turn.

Leve, Hamilton and Peck, Spacecraft Momentum Control Systems, 2015, sections 3.3 and 4.2. A rotor
has the momentum H relative to the body along its spin axis, which a gimbal turns by the angle δ
about the gimbal axis g. With s the spin axis at δ = 0, and t = g × s:

    h = H (cos δ s + sin δ t),    τ = -dδ/dt H (cos δ t - sin δ s) - dH/dt h / H

is the momentum and the torque on the body. Motors keep H constant until a rotor runs down,
dH/dt = -H / T. The inertia of the spacecraft includes rotors and gimbals, and does not change with
the angles; gimbals follow their commands instantly, within a rate limit.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, concrete, require_positive
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.gimbals import ACROSS, GimbalFailureKind
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import SECONDS, WHEEL_MOMENTUM
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.axes import of_each, unit_axes
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import AbstractEffector, Effect, EffectorContext, Reach
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.spacecraft import PlantState, inverse_of
from jaxsat.spacecraft.steering import AbstractSteering, SteeringContext

NEARLY_SINGULAR = 0.1
"""det(A Aᵀ) of unit columns A below which gimbal rates are damped; an even set has over 1."""

DAMPING = 0.01
"""Damping added to A Aᵀ where its determinant is zero."""


class GimbalFailures(AbstractFailures):
    """Failures of gyros, of a `GimbalFailureKind`."""

    part: ClassVar[str] = "gimbal"
    kinds: ClassVar[type[AbstractFailureKind]] = GimbalFailureKind

    def largest_amount(self) -> np.ndarray:
        """Return the longest run-down time constant of each rotor, s."""
        return np.full(self.count, SECONDS.high)

    def condition(
        self, struck: Bool[Array, " f"], count: int
    ) -> tuple[Bool[Array, " k"], Float[Array, " k"]]:
        """Whether each of `count` gimbals is locked, and relative slowing of rotors, 1/s."""
        last = self.last(struck, count)
        runs_down = last.kind == GimbalFailureKind.RUN_DOWN
        time = jnp.where(runs_down & (last.amount > 0), last.amount, 1.0)
        return last.kind == GimbalFailureKind.LOCKED, jnp.where(runs_down, 1 / time, 0.0)


class GyroStates(eqx.Module):
    """State of control moment gyros: gimbal angles (rad) and momenta of rotors (N m s)."""

    angle: Float[Array, " k"] = eqx.field(converter=as_float)
    momentum: Float[Array, " k"] = eqx.field(converter=as_float)


class GyroPiece(NamedTuple):
    """Gimbal rates (rad/s), and relative slowing of rotors (1/s)."""

    rate: Float[Array, " k"]
    slowing: Float[Array, " k"]


class ControlMomentGyros(AbstractEffector):
    """k single-gimbal control moment gyros, each commanded by a gimbal rate, rad/s.

    `gimbal_axes` and `spin_axes` (3, k), the latter at gimbal angles of zero, are scaled to unit
    length. `rotor_momentum` (N m s) is that of each rotor, `rate_limit` (rad/s) bounds gimbal
    rates; each is one number, or one for each gyro. `failures` strike in flight. `slowing` (1/s) is
    the relative slowing of rotors after failures, None without. Raises `ValueError` for axes that
    are not perpendicular, a momentum of zero, and a rate limit that is not above zero and finite.
    """

    kind: ClassVar[str] = "gimbal"
    columns_change: ClassVar[bool] = True
    dispersible: ClassVar[Mapping[str, Dispersible]] = {
        "rotor_momentum": Dispersible(
            lambda one, state, change: (
                one,
                GyroStates(state.angle, state.momentum * (1 + change)),
            ),
            lambda one: Limits.of_change(WHEEL_MOMENTUM, one.rotor_momentum),
        )
    }

    gimbal_axes: Float[Array, "3 k"]
    spin_axes: Float[Array, "3 k"]
    rotor_momentum: Float[Array, " k"]
    rate_limit: Float[Array, " k"]
    failures: GimbalFailures | None
    slowing: Float[Array, " k"] | None = eqx.field(converter=as_optional_float)

    def __init__(
        self,
        gimbal_axes: ArrayLike | list,
        spin_axes: ArrayLike | list,
        rotor_momentum: ArrayLike | list,
        rate_limit: ArrayLike | list,
        failures: GimbalFailures | None = None,
    ):
        self.gimbal_axes = unit_axes(as_float(gimbal_axes))
        self.spin_axes = unit_axes(as_float(spin_axes))
        self.rotor_momentum = of_each(rotor_momentum, self.count)
        self.rate_limit = of_each(rate_limit, self.count)
        self.failures = failures
        self.slowing = None

    def __check_init__(self):
        require_positive("rotor_momentum", self.rotor_momentum)
        require_positive("rate_limit", self.rate_limit)
        if self.spin_axes.shape != self.gimbal_axes.shape:
            rule = f"must have the shape {self.gimbal_axes.shape} of `gimbal_axes`"
            raise ArgumentError("spin_axes", rule, self.spin_axes.shape)
        gimbal, spin = concrete(self.gimbal_axes), concrete(self.spin_axes)
        if gimbal is None or spin is None:
            return
        cosine = np.abs(np.sum(gimbal * spin, axis=0))
        if np.any(cosine > ACROSS):
            rule = "must be perpendicular to `gimbal_axes`"
            raise ArgumentError("spin_axes", rule, f"cosines up to {cosine.max():.3g}")

    @classmethod
    def from_tables(
        cls, tables: Sequence[Any], context: EffectorContext
    ) -> "tuple[ControlMomentGyros, GyroStates]":
        """Return the gyros of checked tables `[[gimbal]]`, and their initial states."""

        def each(key: str) -> np.ndarray:
            return np.array([getattr(one, key) for one in tables], float)

        gyros = cls(
            each("axis").T,
            each("spin_axis").T,
            each("rotor_momentum_N_m_s"),
            each("rate_limit_rad_s"),
            GimbalFailures.of_tables(context.failures),
        )
        return gyros, GyroStates(each("angle_rad"), gyros.rotor_momentum)

    @property
    def count(self) -> int:
        """Number of gyros."""
        return self.gimbal_axes.shape[1]

    def directions(
        self, angle: Float[Array, " k"]
    ) -> tuple[Float[Array, "3 k"], Float[Array, "3 k"]]:
        """Return unit vectors along each rotor's momentum, and along its change by the gimbal."""
        across = jnp.cross(self.gimbal_axes, self.spin_axes, axis=0)
        cosine, sine = jnp.cos(angle)[None], jnp.sin(angle)[None]
        along = cosine * self.spin_axes + sine * across
        return along, cosine * across - sine * self.spin_axes

    # State, effect and derivative.

    def init(self) -> GyroStates:
        """Return the initial state: angles of zero, and all rotors at their momentum."""
        return GyroStates(jnp.zeros(self.count), self.rotor_momentum)

    def with_momenta(self, state: GyroStates, change) -> GyroStates:
        """Return the state with rotor momenta changed; angles do not depend on the body's size."""
        return GyroStates(state.angle, change(state.momentum))

    def momentum(self, state: GyroStates) -> Vector:
        """Return Σ h in body axes, N m s."""
        return self.directions(state.angle)[0] @ state.momentum

    def piece(self, mode: tuple, command: Float[Array, " k"]) -> GyroPiece:
        """Return the gimbal rates within their limits, and the slowing of rotors."""
        slowing = jnp.zeros(self.count) if self.slowing is None else self.slowing
        return GyroPiece(jnp.clip(command, -self.rate_limit, self.rate_limit), slowing)

    def effect(self, piece: GyroPiece, t, plant, state: GyroStates) -> Effect:
        """Return the torque on the body: -dh/dt relative to the body, N m."""
        along, change = self.directions(state.angle)
        momentum = state.momentum
        return Effect(along @ (piece.slowing * momentum) - change @ (piece.rate * momentum))

    def derivative(self, piece: GyroPiece, plant, state: GyroStates, acceleration) -> GyroStates:
        """Return the rates of the state: dδ/dt of gimbals and dH/dt of rotors."""
        return GyroStates(piece.rate, -piece.slowing * state.momentum)

    def signals(self, piece: GyroPiece, state: GyroStates, acceleration) -> dict[str, Array]:
        """Return the rate of each gimbal (rad/s), by the name of its signal."""
        return {"gimbal_rate": piece.rate}

    def stored(self, state: GyroStates) -> dict[str, Array]:
        """Return the angle of each gimbal (rad), by the name of its signal."""
        return {"gimbal_angle": state.angle}

    # Failures in flight, and the remaining reach.

    def _condition(self, struck: Bool[Array, " f"]) -> tuple[Bool[Array, " k"], Float[Array, " k"]]:
        if self.failures is None:
            return jnp.zeros(self.count, bool), jnp.zeros(self.count)
        return self.failures.condition(struck, self.count)

    def driven(
        self, state: GyroStates, command: Float[Array, " k"], struck: Bool[Array, " f"]
    ) -> "tuple[ControlMomentGyros, Float[Array, ' k']]":
        """Return gyros after their failures, and gimbal rates, zero for locked ones, rad/s."""
        if self.failures is None:
            return self, command
        locked, slowing = self._condition(struck)
        intact = eqx.tree_at(
            lambda one: (one.failures, one.slowing),
            self,
            (None, slowing),
            is_leaf=lambda x: x is None,
        )
        return intact, jnp.where(locked, 0.0, command)

    def reach(self, t, plant, state: GyroStates, struck, span) -> Reach:
        """Return the torque of each gyro per gimbal rate (rad/s), -H (cos δ t - sin δ s), N m."""
        _, change = self.directions(state.angle)
        rate = jnp.where(self._condition(struck)[0], 0.0, self.rate_limit)
        return Reach(-change * state.momentum[None], -rate, rate)


class GimbalSteering(AbstractSteering):
    """Gimbal rates that make a torque: A dδ/dt = τ, with A the columns of the gyros' reach.

    τ is the law's command plus ω × h, which cancels the gyroscopic torque of the momentum h of the
    `gyros`. Rates are least squares within the limits of the gimbals; of a torque out of reach, the
    greatest part is made. Near a singular set of angles, where no rate makes a torque about some
    axis, rates are those of the singularity-robust inverse Aᵀ (A Aᵀ + λ 1)⁻¹, in which λ grows from
    zero (Nakamura and Hanafusa, J. Dynamic Systems, Measurement and Control 108, 1986). There is no
    null motion, so angles may reach a singular set and stay. `working` is 1 for each commanded
    gyro, 0 for others. The torque that gyros do not make is left to others.
    """

    kind: ClassVar[str] = ControlMomentGyros.kind

    gyros: ControlMomentGyros
    working: Float[Array, " k"] = eqx.field(converter=as_float)

    @classmethod
    def from_tables(
        cls, effector: ControlMomentGyros, tables: Sequence[Any], context: SteeringContext
    ) -> "GimbalSteering":
        """Return the steering of the gyros without a failure before the start."""
        working = np.array([not one.failed for one in tables], float)
        return cls(cast(ControlMomentGyros, effector.without_corners()), working)

    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """Return the rate of each gimbal (rad/s), and the command left to others (N m)."""
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
    """Return uses of unit columns that make a torque (N m), damped near a lost direction."""
    square = columns @ columns.T
    determinant = jnp.dot(square[0], jnp.cross(square[1], square[2]))
    lack = jnp.maximum(1 - determinant / NEARLY_SINGULAR, 0.0)
    return columns.T @ (inverse_of(square + DAMPING * lack**2 * jnp.eye(3)) @ torque)
