"""Magnetorquers: coils or rods whose magnetic dipole turns the body in the Earth's field."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, not_negative, positive, require_positive
from jaxsat.core.declaration.failures import AbstractFailureKind, FailureKind
from jaxsat.core.ranges import MISALIGNMENT
from jaxsat.spacecraft.allocation import allocate
from jaxsat.spacecraft.axes import of_each, turned_axes, unit_axes
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import AbstractEffector, Dipoles, Effect, EffectorContext, Reach
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.spacecraft import PlantState
from jaxsat.spacecraft.steering import AbstractSteering, SteeringContext
from jaxsat.spacecraft.wheels import wheel_momentum

NEAREST = 0.05
"""Sine of the angle between the field and the axes of two magnetorquers below which they make less
of a dipole across these axes: their own would be too large."""


class MagnetorquerFailures(AbstractFailures):
    """Failures of magnetorquers, of a `FailureKind`.

    They may be dead, degraded, stuck or reversed; `amount` is that of the kind, for a stuck one the
    dipole over its limit, from -1 to 1.
    """

    part: ClassVar[str] = "magnetorquer"
    kinds: ClassVar[type[AbstractFailureKind]] = FailureKind

    def two_signed(
        self, struck: Bool[Array, " f"], count: int
    ) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
        """Return gain and level of the dipoles: gain x commanded + level x limit."""
        return self.last(struck, count).two_signed()


class Magnetorquers(AbstractEffector):
    """k magnetorquers along any axes, of shape (3, k) in body axes, scaled to unit length.

    `dipole_limit` (A m²), one number or one for each, bounds their dipoles, which follow commands
    instantly. They act in the Earth's magnetic `field`. `failures` strike in flight. Raises
    `ValueError` for an axis or a limit of zero.
    """

    kind: ClassVar[str] = "magnetorquer"
    columns_change: ClassVar[bool] = True
    dispersible: ClassVar[Mapping[str, Dispersible]] = {
        "magnetorquer_misalignment": Dispersible(
            lambda one, state, angles: (one.misaligned(angles.reshape(one.count, 2)), state),
            lambda one: Limits.between(MISALIGNMENT),
            each=2,
        )
    }

    axes: Float[Array, "3 k"]
    dipole_limit: Float[Array, " k"]
    field: AbstractMagneticField
    failures: MagnetorquerFailures | None

    def __init__(
        self,
        axes: ArrayLike | list,
        dipole_limit: ArrayLike | list,
        field: AbstractMagneticField,
        failures: MagnetorquerFailures | None = None,
    ):
        self.axes = unit_axes(as_float(axes))
        self.dipole_limit = of_each(dipole_limit, self.count)
        self.field = field
        self.failures = failures

    def __check_init__(self):
        require_positive("dipole_limit", self.dipole_limit)

    @classmethod
    def from_tables(
        cls, tables: Sequence[Any], context: EffectorContext
    ) -> "tuple[Magnetorquers, None]":
        """Return the magnetorquers of checked tables `[[magnetorquer]]` of a scenario."""
        axes = np.array([one.axis for one in tables], float).T
        limits = np.array([one.dipole_limit_A_m2 for one in tables])
        failures = MagnetorquerFailures.of_tables(context.failures)
        return cls(unit_columns(axes), limits, context.field, failures), None

    @property
    def count(self) -> int:
        """Number of magnetorquers."""
        return self.axes.shape[1]

    def dipoles(self) -> Dipoles:
        """Return axes, dipole limits and field."""
        return Dipoles(self.axes, self.dipole_limit, self.field)

    def driven(
        self, state: None, command: Float[Array, " k"], struck: Bool[Array, " f"]
    ) -> "tuple[Magnetorquers, Float[Array, ' k']]":
        """Return magnetorquers after their failures, and the dipole of each, A m²."""
        if self.failures is None:
            return self, command
        gain, level = self.failures.two_signed(struck, self.count)
        intact = eqx.tree_at(lambda one: one.failures, self, None)
        return intact, gain * self.piece((), command) + level * self.dipole_limit

    def reach(self, t, plant, state: None, struck, span) -> Reach:
        """Return the torque of each per 1 A m², a × B (N m), a its axis: all perpendicular to B."""
        field = self.field.in_body(jnp.asarray(t), plant.attitude)
        columns = jnp.cross(self.axes, field[:, None], axis=0)
        gain, level = jnp.ones(self.count), jnp.zeros(self.count)
        if self.failures is not None:
            gain, level = self.failures.two_signed(struck, self.count)
        most = self.dipole_limit
        return Reach(columns, (level - jnp.abs(gain)) * most, (level + jnp.abs(gain)) * most)

    def piece(self, mode: tuple, command: Float[Array, " k"]) -> Float[Array, " k"]:
        """Return the dipole of each magnetorquer for a command, within its limit, A m²."""
        return jnp.clip(command, -self.dipole_limit, self.dipole_limit)

    def effect(self, piece: Float[Array, " k"], t, plant, state: None) -> Effect:
        """Return the torque on the body, m × B (N m), of the total dipole m."""
        field = self.field.in_body(jnp.asarray(t), plant.attitude)
        return Effect(jnp.cross(self.axes @ piece, field))

    def signals(self, piece: Float[Array, " k"], state: None, acceleration) -> dict[str, Array]:
        """Return the dipole of each magnetorquer (A m²), by the name of its signal."""
        return {"dipole": piece}

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """Return the dipole of each, A m², by the name of its flight command."""
        return {"dipole": use}, memory

    def misaligned(self, angles: Float[Array, "k 2"]) -> "Magnetorquers":
        """Return magnetorquers turned by small angles (rad) towards two directions across."""
        return eqx.tree_at(lambda one: one.axes, self, turned_axes(self.axes, angles))


class MagneticSteering(AbstractSteering):
    """Dipoles m = B × τ / |B|², which make the part of a wanted torque τ across the field B.

    τ = `command_part` u - `unloading` (A h - h0): a part of the law's command u (N m), and the
    unloading at `unloading` (1/s) of the momentum beyond the `bias` h0 (N m s) from wheels along
    `wheel_axes` A. `shares` (k, 3) maps to dipoles of the magnetorquers along `axes`. Among all
    dipoles with the same torque these have the least sum of squares over the `dipole_limit` (A m²)
    of each, within the limits; of a torque out of reach, the greatest part is made. Their torque is
    subtracted from the command of all other actuators, so that the body receives the law's torque.
    B is that of the `field` at the law's attitude. Sidi, Spacecraft Dynamics and Control, 1997,
    sections 7.4 and 7.5: the cross-product law.
    """

    kind: ClassVar[str] = Magnetorquers.kind

    field: AbstractMagneticField
    axes: Float[Array, "3 k"] = eqx.field(converter=as_float)
    shares: Float[Array, "k 3"] = eqx.field(converter=as_float)
    dipole_limit: Float[Array, " k"] = eqx.field(converter=positive("dipole_limit"))
    command_part: Matrix = eqx.field(converter=as_float)
    unloading: RealScalar = eqx.field(converter=not_negative("unloading"), default=0.0)
    wheel_axes: Float[Array, "3 wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    bias: Vector = eqx.field(converter=as_float, default=(0.0, 0.0, 0.0))

    @classmethod
    def from_tables(
        cls, effector: Magnetorquers, tables: Sequence[Any], context: SteeringContext
    ) -> "MagneticSteering":
        """Return the steering for the rest of the wheels' torque, and for unloading of wheels.

        Magnetorquers that failed before the start get no command.
        """
        axes, working = np.asarray(effector.axes), [not one.failed for one in tables]
        shares = np.zeros((axes.shape[1], 3))
        shares[working] = np.linalg.pinv(axes[:, working])
        limit, (wheels, rest, unloading, bias) = effector.dipole_limit, context
        return cls(effector.field, axes, shares, limit, rest, unloading, wheels, bias)

    def __call__(
        self, t: RealScalar, state: PlantState, command: Vector
    ) -> tuple[Float[Array, " k"], Vector]:
        """Return the dipole of each magnetorquer (A m²), and the command left to others (N m)."""
        field = self.field.in_body(t, state.attitude)
        dipoles, torque = self.within_limits(field, self.demand(state, command))
        return dipoles, command - torque

    def within_limits(
        self, field: Vector, torque: Vector, besides: Float[Array, " k"] | float = 0.0
    ) -> tuple[Float[Array, " k"], Vector]:
        """Return dipoles (A m²) for a torque (N m) in a field (T, body axes), and their torque.

        Dipoles that are commanded `besides` (A m², within the limits) leave them the rest.
        """
        reach = self.reach(field)
        room = reach._replace(low=reach.low - besides, high=reach.high - besides)
        dipoles = allocate(room, reach.columns @ self.unlimited(field, torque)).use
        return dipoles, reach.columns @ dipoles

    def shortened(self, dipoles: Float[Array, " k"]) -> Float[Array, " k"]:
        """Return dipoles (A m²) all reduced by one factor where one is beyond its limit."""
        return dipoles / jnp.maximum(jnp.max(jnp.abs(dipoles) / self.dipole_limit), 1.0)

    def reach(self, field: Vector) -> Reach:
        """Return the torque of each dipole per A m² in a field (T, body axes), within its limit."""
        limit = jnp.where(jnp.any(self.shares != 0, axis=1), self.dipole_limit, 0.0)
        return Reach(jnp.cross(self.axes, field[:, None], axis=0), -limit, limit)

    def within_reach(self, t: RealScalar, state: PlantState, torque: Vector) -> Vector:
        """Return the torque of unlimited dipoles (N m), which has no component along the field."""
        field = self.field.in_body(t, state.attitude)
        across = jnp.cross(self.axes, field[:, None], axis=0)
        return across @ self.unlimited(field, self.demand(state, torque))

    def demand(self, state: PlantState, command: Vector) -> Vector:
        """Return the torque (N m) wanted of the dipoles for a command of the law (N m)."""
        return self.command_part @ command - self.unloading * self.excess(state)

    def unlimited(self, field: Vector, torque: Vector) -> Float[Array, " k"]:
        """Return unlimited dipoles (A m²) for a torque in a field (T, body axes)."""
        return self.turned(field, jnp.cross(field, torque) / jnp.sum(field**2))

    def turned(self, field: Vector, dipole: Vector) -> Float[Array, " k"]:
        """Return dipoles (A m²) with the torque of a `dipole` in a field (T, body axes).

        With P on what the axes span and Q = 1 - P they are P (m - β B), where Q (m - β B) is least.
        With magnetorquers along two axes that is zero, and the torque the same. Near a field in
        that span, within `NEAREST`, β is less.
        """
        beyond, missing = (one - self.axes @ (self.shares @ one) for one in (field, dipole))
        square = jnp.sum(beyond**2) + NEAREST**2 * jnp.sum(field**2)
        return self.shares @ (dipole - field * (jnp.sum(missing * beyond) / square))

    def excess(self, state: PlantState) -> Vector:
        """Return the momentum of the wheels beyond their bias, N m s, in body axes."""
        momentum = wheel_momentum(state)
        if self.wheel_axes is None or momentum is None:
            return jnp.zeros_like(state.omega)
        return self.wheel_axes @ momentum - self.bias
