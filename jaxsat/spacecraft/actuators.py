"""Two-sided thrusters with a continuous torque, and actuators from plug-ins."""

import abc
import dataclasses
from collections.abc import Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.allocation import allocation_matrix
from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_float, as_optional_float, concrete, positive
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.smooth import sat
from jaxsat.spacecraft.allocation import first_at_limit, share_within
from jaxsat.spacecraft.axes import turned_axes
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.effector import AbstractEffector, Effect, Reach
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.thrusters import DISPERSIBLE, Thrusters


class AbstractActuators(eqx.Module):
    """Map from the torque that a control law commands to the torque on the body.

    Actuators that a scenario can name also have a `declaration`, a `PartDeclaration`, and a class
    method `from_table(values, context)`: `values` has every declared key, `context` is an
    `ActuatorContext`.
    """

    @property
    @abc.abstractmethod
    def event_count(self) -> int:
        """Number of corners of the torque as a function of the command."""

    @abc.abstractmethod
    def __call__(self, command: Float[Array, " torques"]) -> Vector:
        """Return the body torque, N m, for a command of two or three torques, N m."""

    @abc.abstractmethod
    def event_functions(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Functions of the command whose zeros are the corners."""

    @abc.abstractmethod
    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractActuators":
        """Return these actuators held on the side of each corner that `signs` gives."""


class AbstractSmoothActuators(AbstractActuators):
    """Actuators without corners, or under a sampled law, for which corners do not matter."""

    @property
    def event_count(self) -> int:
        """Number of corners of the torque: zero."""
        return 0

    def event_functions(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Functions of the command whose zeros are the corners: an empty array."""
        return jnp.zeros(0, command.dtype)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractSmoothActuators":
        """Return these actuators, as they have no corners."""
        return self


class Actuators(AbstractEffector):
    """Two-sided thrusters that turn a commanded torque into a body torque.

    The command is (u1, u2) about body x and y, or a torque about each body axis. `torque_axes`
    (3, m) are the directions of the working thrusters' torques, `thrust_map` (m, 2) or (m, 3)
    shares the command among them, and `limit` (N m, may be infinite) bounds each thruster. The
    map is the allocator's: `misaligned` changes the true axes and leaves the map unchanged.
    `saturated` holds each thruster on one side of its limit, see `smooth_piece`. `failures` strike
    in flight and leave `gain` times the thrust plus `level` times the limit; None means no failure.

    With `shared_axes` (3, m), the allocator's knowledge of the axes, other thrusters make up for a
    saturated one; of a torque beyond the limits of all, the greatest part is made in its direction.
    With None (commands of two torques) each thruster is clipped at its own limit: equation (5).
    """

    kind: ClassVar[str] = "thruster"
    even: ClassVar[bool] = True
    mild_corners: ClassVar[bool] = True
    dispersible: ClassVar[Mapping[str, Dispersible]] = DISPERSIBLE

    torque_axes: Float[Array, "3 m"] = eqx.field(converter=as_float)
    thrust_map: Float[Array, "m torques"] = eqx.field(converter=as_float)
    limit: RealScalar = eqx.field(converter=positive("limit"), default=jnp.inf)
    saturated: Bool[Array, " m"] | None = None
    failures: FailureEvents | None = None
    gain: Float[Array, " m"] | None = None
    level: Float[Array, " m"] | None = None
    shared_axes: Float[Array, "3 m"] | None = eqx.field(converter=as_optional_float, default=None)

    @staticmethod
    def of(
        thrusters: Thrusters, limit: float | RealScalar = jnp.inf, torques: int = 2
    ) -> "Actuators":
        """Return actuators of the working thrusters, each limited to `limit` N m.

        Raises `ValueError` unless the thrusters make the first `torques` torques independently.
        """
        axes = thrusters.torque_axes
        shares = allocation_matrix(np.asarray(axes), torques)
        return Actuators(
            torque_axes=axes,
            thrust_map=shares,
            limit=limit,
            shared_axes=axes if torques == 3 else None,
        )

    def misaligned(self, angles: Float[Array, "m 2"]) -> "Actuators":
        """Return these thrusters misaligned, with the command allocated as if they were ideal.

        `angles` (rad) turn each torque axis towards two fixed perpendicular directions; the
        tangents use the small-angle approximation.
        """
        return self._of_others(turned_axes(self.torque_axes, angles))

    def stronger(self, change: Float[Array, " m"]) -> "Actuators":
        """Return thrusters that make 1 + `change` times their nominal torque."""
        return self._of_others(self.torque_axes * (1 + change)[None])

    def _of_others(self, axes: Float[Array, "3 m"]) -> "Actuators":
        failures = self.failures
        if failures is not None:
            failures = failures.of_others(self.torque_axes, axes)
        return dataclasses.replace(self, torque_axes=axes, failures=failures)

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.torque_axes.shape[1]

    @property
    def command_size(self) -> int:
        """Number of commanded torques that the thrusters share: two or three."""
        return self.thrust_map.shape[1]

    @property
    def event_count(self) -> int:
        """Number of corners of the torque: one for each thruster."""
        return self.count

    def thrust(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Return the torque of each thruster for a command, within its limit, N m."""
        return self._shared(command)[0]

    def unmade(self, use: Float[Array, " torques"]) -> Vector:
        """Return the torque beyond the thrusters' limits, N m."""
        return self._shared(use)[1]

    def _shared(self, command: Float[Array, " torques"]) -> tuple[Float[Array, " m"], Vector]:
        shares = self.thrust_map @ command
        if self.shared_axes is None:
            clipped = sat(shares, self.limit, None, self.saturated)
            return clipped, self.torque_axes @ (shares - clipped)
        limit = self.limit * jnp.ones_like(shares)
        return share_within(self.shared_axes, limit, shares, self.saturated)

    def __call__(self, command: Float[Array, " torques"]) -> Vector:
        """The body torque, N m: T of equation (5)."""
        thrust = self.thrust(command)
        if self.gain is not None and self.level is not None:
            full = jnp.where(jnp.isfinite(self.limit), self.limit, 0.0)
            thrust = self.gain * thrust + self.level * full
        return self.torque_axes @ thrust

    def piece(self, mode: tuple, command: Float[Array, " torques"]) -> Vector:
        """The body torque, N m."""
        return self(command)

    def effect(self, piece: Vector, t, plant, state: None) -> Effect:
        """The torque on the body (N m), with no correction of its inertia."""
        return Effect(piece)

    def driven(
        self, state: None, command: Float[Array, " torques"], struck: Bool[Array, " f"]
    ) -> "tuple[Actuators, Float[Array, ' torques']]":
        """Return these thrusters after the failures that have struck, and the unchanged command."""
        return self._after_failures(struck), command

    def _after_failures(self, struck: Bool[Array, " f"]) -> "Actuators":
        if self.failures is None:
            return self
        gain, level, axes = self.failures.two_signed(struck, self.torque_axes)
        return dataclasses.replace(self, torque_axes=axes, gain=gain, level=level, failures=None)

    def reach(self, t, plant, state: None, struck, span) -> Reach:
        """Return the reach: the torque of each thruster (N m), of either sign."""
        now = self._after_failures(struck)
        gain, level = 1.0, 0.0
        if now.gain is not None and now.level is not None:
            gain, level = jnp.abs(now.gain), now.level
        room = jnp.where(gain > 0, self.limit, 0.0) * jnp.where(gain > 0, gain, 1.0)
        level_torque = level * jnp.where(jnp.isfinite(self.limit), self.limit, 0.0)
        each = jnp.zeros(now.torque_axes.shape[1])
        return Reach(now.torque_axes, each + level_torque - room, each + level_torque + room)

    def last_drawn_kind(self, sampled: bool) -> FailureKind:
        """Last failure kind that a study draws: stuck with a finite limit, else degraded."""
        limit = concrete(self.limit)
        limited = limit is not None and bool(np.all(np.isfinite(limit)))
        return FailureKind.STUCK_AT if limited else FailureKind.DEGRADED

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """Return the torque of each thruster, N m, by the name of its flight command."""
        return {"thrust": self.thrust(use)}, memory

    def event_functions(self, state: None, command, acceleration) -> Float[Array, " m"]:
        """Return event functions, positive for each thruster beyond its limit, or the first."""
        shares = self.thrust_map @ command
        if self.shared_axes is not None:
            return first_at_limit(shares, self.limit * jnp.ones_like(shares))
        return (shares / self.limit) ** 2 - 1

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "Actuators":
        """Return these thrusters, each at its limit or not as `signs` gives."""
        return dataclasses.replace(self, saturated=signs)


class PluginActuators(AbstractEffector):
    """Actuators of a plug-in, as an effector that takes `torques` commanded torques.

    Actuators that store the ideal thrusters of their context have the same dispersible quantities.
    """

    kind: ClassVar[str] = "thruster"
    even: ClassVar[bool] = True

    actuators: AbstractActuators
    torques: int = eqx.field(static=True)
    failures: None = None

    @property
    def dispersible(self) -> Mapping[str, Dispersible]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Dispersible quantities of the stored thrusters; empty unless one set is stored."""
        if len(_stored(self)) != 1:
            return {}
        return {name: _of_stored(one) for name, one in DISPERSIBLE.items()}

    @property
    def count(self) -> int:
        """Number of devices: one for each torque."""
        return self.torques

    def driven(
        self, state: None, command: Float[Array, " torques"], struck: Bool[Array, "0"]
    ) -> "tuple[PluginActuators, Float[Array, ' torques']]":
        """Return these actuators and the command unchanged: plug-in actuators do not fail."""
        return self, command

    def piece(self, mode: tuple, command: Float[Array, " torques"]) -> Vector:
        """The body torque, N m."""
        return self.actuators(command)

    def effect(self, piece: Vector, t, plant, state: None) -> Effect:
        """The torque on the body (N m), with no correction of its inertia."""
        return Effect(piece)

    @property
    def event_count(self) -> int:
        """Number of corners of the actuators' torque."""
        return self.actuators.event_count

    def event_functions(self, state: None, command, acceleration) -> Float[Array, " m"]:
        """Return the actuators' event functions of the command."""
        return self.actuators.event_functions(command)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "PluginActuators":
        """Return the actuators held on the side of each corner that `signs` gives."""
        piece = self.actuators.smooth_piece(signs)
        return PluginActuators(actuators=piece, torques=self.torques)


def _is_thrusters(part: object) -> bool:
    return isinstance(part, Actuators)


def _stored(effector: PluginActuators) -> list[Actuators]:
    """Return the sets of ideal thrusters that the actuators store."""
    return [one for one in jax.tree.leaves(effector, is_leaf=_is_thrusters) if _is_thrusters(one)]


def _of_stored(own: Dispersible) -> Dispersible:
    """Return a dispersible quantity of thrusters as one of the actuators that store them."""

    def changed(effector: PluginActuators, state, values):
        def change(part):
            return own.changed(part, state, values)[0] if _is_thrusters(part) else part

        return jax.tree.map(change, effector, is_leaf=_is_thrusters), state

    def thrusters(effector: PluginActuators) -> Actuators:
        return _stored(effector)[0]

    return Dispersible(changed, lambda one: own.limits(thrusters(one)), own.each, thrusters)


class ActuatorContext(NamedTuple):
    """Inputs from a scenario for actuators besides their own keys.

    `ideal` are the working thrusters of jaxsat without actuators of another kind: torque axes,
    allocation of the command, and limit. The law commands `torques` torques, 2 or 3, or 0 for none.
    """

    ideal: Actuators
    torques: int
