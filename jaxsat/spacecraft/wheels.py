"""Reaction wheels: their torque, and the edges at which momenta reach a limit or zero.

A wheel's momentum h is relative to the body, and the inertia of the spacecraft includes its locked
wheels. A motor with a commanded torque c turns the body by c and the wheel by -c; viscous and
Coulomb friction b and τ brake the wheel and drag the body along. A rotor with the inertia J_w
about its axis a also lags behind an accelerating body:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

At its limit a wheel takes no torque that would raise its momentum further. The mode is the set of
held wheels; `jaxsat.spacecraft.wheel_motion` computes it, and its changes in closed form where they
do not depend on the body.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import Matrix, Vector
from jaxsat.core.checks import as_float, concrete, require_finite, require_positive
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import TORQUE
from jaxsat.spacecraft import wheel_failures, wheel_motion
from jaxsat.spacecraft.axes import of_each, unit_axes
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import AbstractEffector, Effect, EffectorContext, Reach, Storage
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheel_motion import WheelPiece, WheelStates, first_states

OfEach = ArrayLike | list | tuple | None
"""One number, one for each wheel, or None."""

STATE_PASSES = 3
"""Number of passes for the set of held wheels, each with the rates of the last."""


class WheelMomenta(eqx.Module):
    """State of wheels: the momentum of each relative to the body, N m s."""

    momentum: Float[Array, " wheels"] = eqx.field(converter=as_float)


def _momentum_limits(one: "Wheels") -> Limits:
    """Return the limits of drawn momenta: each wheel's momentum limit, at most `TORQUE.high`."""
    limit = as_float(TORQUE.high) if one.momentum_limit is None else one.momentum_limit
    largest = jnp.minimum(limit, TORQUE.high)
    return Limits(-largest, largest)


class Wheels(AbstractEffector):
    """Reaction wheels along any axes, of shape (3, wheels) in body axes, scaled to unit length.

    `torque_limit` (N m) bounds each motor's torque and `momentum_limit` (N m s) each momentum.
    `rotor_inertia` (kg m²) is that of each rotor about its axis, part of the spacecraft's inertia.
    `viscous_friction` (N m s/rad), which needs a rotor inertia, and `coulomb_friction` (N m) brake
    the rotors. Each is one number, or one for each wheel, or None. `failures` strike in flight.
    `limited` holds each wheel at its momentum limit or off it, see `smooth_piece`, `seized` marks
    seized wheels at rest. Raises `ValueError` for numbers outside their ranges.
    """

    kind: ClassVar[str] = "wheel"
    blows: ClassVar[bool] = True
    dispersible: ClassVar[Mapping[str, Dispersible]] = {
        "wheel_momentum": Dispersible(
            lambda one, state, momentum: (one, WheelMomenta(momentum)), _momentum_limits
        )
    }

    axes: Float[Array, "3 wheels"]
    torque_limit: Float[Array, " wheels"] | None
    momentum_limit: Float[Array, " wheels"] | None
    rotor_inertia: Float[Array, " wheels"] | None
    viscous_friction: Float[Array, " wheels"] | None
    coulomb_friction: Float[Array, " wheels"] | None
    failures: WheelFailures | None
    limited: Bool[Array, " wheels"] | None
    seized: Bool[Array, " wheels"] | None

    def __init__(
        self,
        axes: ArrayLike | list,
        torque_limit: OfEach = None,
        momentum_limit: OfEach = None,
        rotor_inertia: OfEach = None,
        viscous_friction: OfEach = None,
        coulomb_friction: OfEach = None,
        failures: WheelFailures | None = None,
    ):
        self.axes = unit_axes(as_float(axes))
        self.torque_limit = self._of_each(torque_limit)
        self.momentum_limit = self._of_each(momentum_limit)
        self.rotor_inertia = self._of_each(rotor_inertia)
        self.viscous_friction = self._of_each(viscous_friction)
        self.coulomb_friction = self._of_each(coulomb_friction)
        self.failures = failures
        self.limited = None
        self.seized = None

    def __check_init__(self):
        for name in ("torque_limit", "momentum_limit"):
            if getattr(self, name) is not None:
                require_positive(name, getattr(self, name))
        for name in ("rotor_inertia", "viscous_friction", "coulomb_friction"):
            if getattr(self, name) is not None:
                require_finite(name, getattr(self, name))
                require_positive(name, getattr(self, name), zero_allowed=True)
        if self.viscous_friction is None:
            return
        if self.rotor_inertia is None:
            raise ArgumentError("rotor_inertia", "must be given with viscous friction", None)
        friction, inertia = concrete(self.viscous_friction), concrete(self.rotor_inertia)
        if friction is not None and inertia is not None and np.any((friction > 0) & (inertia == 0)):
            message = "must be above zero for each wheel with viscous friction"
            raise ArgumentError("rotor_inertia", message, inertia)

    @classmethod
    def from_tables(
        cls, tables: Sequence[Any], context: EffectorContext
    ) -> tuple["Wheels", WheelMomenta]:
        """Return the wheels of checked tables `[[wheel]]` of a scenario, and their initial momenta.

        A property that no wheel has is None.
        """

        def each(key: str, absent: float) -> np.ndarray | None:
            values = np.array([getattr(one, key) or absent for one in tables], float)
            return None if np.all(values == absent) else values

        wheels = cls(
            unit_columns(np.array([one.axis for one in tables], float).T),
            each("torque_limit_N_m", np.inf),
            each("momentum_limit_N_m_s", np.inf),
            each("rotor_inertia_kg_m2", 0.0),
            each("viscous_friction_N_m_s", 0.0),
            each("coulomb_friction_N_m", 0.0),
            WheelFailures.of_tables(context.failures),
        )
        return wheels, WheelMomenta(np.array([one.momentum_N_m_s for one in tables]))

    def _of_each(self, value: OfEach) -> Float[Array, " wheels"] | None:
        return None if value is None else of_each(value, self.count)

    @property
    def count(self) -> int:
        """Number of wheels."""
        return self.axes.shape[1]

    def rotors(self, turns: Bool[Array, " wheels"] | None = None) -> Matrix:
        """Return Σ J_w a aᵀ (kg m²) over turning wheels, by default all: a part of the body."""
        if self.rotor_inertia is None:
            return jnp.zeros((3, 3))
        inertia = self.rotor_inertia if turns is None else jnp.where(turns, self.rotor_inertia, 0.0)
        return self.axes @ (inertia[:, None] * self.axes.T)

    @property
    def decay(self) -> Float[Array, " wheels"]:
        """Relative decay of momenta by viscous friction, b / J_w, 1/s."""
        if self.viscous_friction is None or self.rotor_inertia is None:
            return jnp.zeros(self.count)
        inertia = jnp.where(self.rotor_inertia > 0, self.rotor_inertia, 1.0)
        return self.viscous_friction / inertia

    def motor_torque(self, command: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """Return the motor torques for a command, N m, without friction and momentum limit."""
        if self.torque_limit is None:
            return command
        return jnp.clip(command, -self.torque_limit, self.torque_limit)

    def _drag(self, acceleration: Vector) -> Float[Array, " wheels"]:
        if self.rotor_inertia is None:
            return jnp.zeros(self.count, acceleration.dtype)
        return self.rotor_inertia * (self.axes.T @ acceleration)

    # State, effect and derivative.

    def init(self) -> WheelMomenta:
        """Return the state with all wheels at rest."""
        return WheelMomenta(jnp.zeros(self.count))

    def with_momenta(self, state: WheelMomenta, change) -> WheelMomenta:
        """Return the state with each wheel's momentum changed."""
        return WheelMomenta(change(state.momentum))

    def momentum(self, state: WheelMomenta) -> Vector:
        """Return the momentum of all wheels relative to the body, A h in body axes, N m s."""
        return self.axes @ state.momentum

    def storage(self) -> Storage:
        """Return the inertia of each rotor, and the momentum limit of each wheel."""
        rotors, most = self.rotor_inertia, self.momentum_limit
        return Storage(
            jnp.zeros(self.count) if rotors is None else rotors,
            jnp.full(self.count, jnp.inf) if most is None else most,
        )

    def free_inertia(self) -> Matrix | None:
        """Return the correction of the inertia by all wheels, -Σ J_w a aᵀ, kg m²."""
        return self._correction(None)

    def _correction(self, turns: Bool[Array, " wheels"] | None) -> Matrix | None:
        return None if self.rotor_inertia is None else -self.rotors(turns)

    @property
    def mode_passes(self) -> int:
        """Number of calls of `mode_after`: zero if `limited` holds the wheels."""
        if self.limited is not None:
            return 0
        return 1 if self.rotor_inertia is None else STATE_PASSES

    def mode(self, state: WheelMomenta) -> WheelStates:
        """Return the wheels' mode by their momenta alone, held wherever possible."""
        return first_states(self, state.momentum)

    def mode_after(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> WheelStates:
        """Return the mode after wheels with a margin below zero have left their state."""
        if self.limited is not None:
            return mode
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.left(mode.margins(self, state.momentum, drive, drag), drive, drag)

    def piece(self, mode: WheelStates, command: Float[Array, " wheels"]) -> WheelPiece:
        """Return the drive and decay of each wheel, and which of them turn."""
        return mode.piece(self, self.motor_torque(command))

    def effect(self, piece: WheelPiece, t, plant, state: WheelMomenta) -> Effect:
        """Return the torque A c (N m), and the correction -Σ J_w a aᵀ (kg m²) of turning wheels."""
        return Effect(self.axes @ piece.torque(state.momentum), self._correction(piece.turns))

    def derivative(
        self, piece: WheelPiece, plant, state: WheelMomenta, acceleration
    ) -> WheelMomenta:
        """Return dh/dt = -c - J_w aᵀdω/dt of turning wheels, N m."""
        return WheelMomenta(self._rate(piece, state, acceleration))

    def _rate(self, piece: WheelPiece, state: WheelMomenta, acceleration):
        rate = -piece.torque(state.momentum)
        if self.rotor_inertia is None:
            return rate
        rate = rate - self._drag(acceleration)
        return rate if piece.turns is None else jnp.where(piece.turns, rate, 0.0)

    def made(
        self, piece: WheelPiece, state: WheelMomenta, acceleration: Vector
    ) -> Float[Array, " wheels"]:
        """Return the torque of each wheel on the body along its axis, N m.

        For a held wheel this is the reaction to turning its rotor with the body.
        """
        torque = piece.torque(state.momentum)
        if piece.turns is None or self.rotor_inertia is None:
            return torque
        return jnp.where(piece.turns, torque, -self._drag(acceleration))

    def torque(self, piece: WheelPiece, effect: Effect, state: WheelMomenta, acceleration):
        """Return the torque A c including the reaction of held rotors, N m."""
        return self.axes @ self.made(piece, state, acceleration)

    def signals(self, piece: WheelPiece, state: WheelMomenta, acceleration) -> dict[str, Array]:
        """Return the torque of each wheel (N m), by the name of its signal."""
        return {"wheel_torque": self.made(piece, state, acceleration)}

    def stored(self, state: WheelMomenta) -> dict[str, Array]:
        """Return the momentum of each wheel (N m s), by the name of its signal."""
        return {"wheel_momentum": state.momentum}

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """Return the torque of each motor on the body, N m, by the name of its flight command."""
        return {"wheel_torque": use}, memory

    # Failures in flight.

    def _stopped(self, struck: Bool[Array, " f"]) -> Bool[Array, " wheels"]:
        if self.failures is None:
            return jnp.zeros(self.count, bool)
        return self.failures.condition(struck, self.count).stopped

    def blow(self, state: WheelMomenta, struck: Bool[Array, " f"]) -> Effect:
        """Return the impulse of seizing wheels (N m s), and the correction by other rotors."""
        stopped = self._stopped(struck)
        impulse = self.axes @ jnp.where(stopped, state.momentum, 0.0)
        return Effect(impulse, self._correction(~stopped))

    def blown(self, state: WheelMomenta, struck: Bool[Array, " f"], change) -> WheelMomenta:
        """Return the state after a blow: seized wheels at rest, J_w aᵀω + h of others unchanged."""
        momentum = state.momentum
        if self.rotor_inertia is not None:
            momentum = momentum - self._drag(change)
        return WheelMomenta(jnp.where(self._stopped(struck), 0.0, momentum))

    def driven(
        self, state: WheelMomenta, command: Float[Array, " wheels"], struck: Bool[Array, " f"]
    ) -> "tuple[Wheels, Float[Array, ' wheels']]":
        """Return wheels in the condition after their failures, and their motor torques, N m."""
        return wheel_failures.driven(self, state.momentum, command, struck)

    def reach(self, t, plant, state: WheelMomenta, struck, span) -> Reach:
        """Return the reach: motor torques less friction, N m, in either direction of the wheel."""
        return wheel_failures.reach(self, state.momentum, struck, span)

    def last_drawn_kind(self, sampled: bool) -> WheelFailureKind:
        """Return the last kind that a study draws: `RUNAWAY` only if all wheels have a torque
        limit, and `FRICTION_TO`, the one before, only under a sampled law."""
        if not sampled:
            return WheelFailureKind.FRICTION_BY
        limits = None if self.torque_limit is None else concrete(self.torque_limit)
        limited = limits is not None and bool(np.all(np.isfinite(limits)))
        return WheelFailureKind.RUNAWAY if limited else WheelFailureKind.FRICTION_TO

    def without_corners(self) -> "Wheels":
        """Return the same wheels without Coulomb friction and failures in flight."""
        return eqx.tree_at(
            lambda one: (one.coulomb_friction, one.failures),
            self,
            (None, None),
            is_leaf=lambda x: x is None or isinstance(x, WheelFailures),
        )

    # A held command: edges, and the piece between two of them.

    @property
    def edge_count(self) -> int:
        """Number of edges: one for each wheel if there is Coulomb friction, and one for each if
        there is a momentum limit."""
        return self.count * sum(x is not None for x in (self.coulomb_friction, self.momentum_limit))

    @property
    def follows_body(self) -> bool:
        """Whether edges must be searched: if rotors have an inertia and wheels may be held."""
        holds = self.edge_count > 0 or self.seized is not None
        return self.rotor_inertia is not None and holds

    def edges(self, state: WheelMomenta, command, period) -> Float[Array, " edges"]:
        """Return the instants (s) at which wheels come to rest or reach their limits."""
        return wheel_motion.edges_of(self, state.momentum, command, period)

    def held_piece(self, state: WheelMomenta, command, elapsed) -> WheelPiece:
        """Return the piece after `elapsed` s, for an even body rate or without a rotor inertia."""
        return wheel_motion.piece_after(self, state.momentum, command, elapsed)

    def snapped(self, state: WheelMomenta, command, elapsed, reached: WheelMomenta) -> WheelMomenta:
        """Return the state with momenta exactly zero, or at the limit, at the edge there."""
        momentum = state.momentum
        return WheelMomenta(
            wheel_motion.snapped(self, momentum, command, elapsed, reached.momentum)
        )

    def margins(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """Return the margins of wheels to leaving rest or a hold, and to their momentum limit."""
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.margins(self, state.momentum, drive, drag)

    def approach(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """Return the rates of the margins of turning wheels; others leave without a jump."""
        rate = self._rate(self.piece(mode, command), state, acceleration)
        speeds = jnp.stack([mode.side * rate, -jnp.sign(state.momentum) * rate])
        return jnp.where(mode.turns[None], speeds, 0.0)

    def come(self, mode: WheelStates, state: WheelMomenta, margins) -> WheelMomenta:
        """Return the state, momenta exactly zero or at the limit for wheels that reached it."""
        return WheelMomenta(mode.snapped(self, state.momentum, margins))

    # A continuous command: events, and the smooth piece between two of them.

    @property
    def event_count(self) -> int:
        """Number of corners: one for each wheel with a momentum limit."""
        return 0 if self.momentum_limit is None else self.count

    def event_functions(self, state: WheelMomenta, command, acceleration) -> Float[Array, " m"]:
        """Return functions that are positive for each wheel held at its limit.

        A wheel reaches the limit by its momentum and leaves it by its driving torque alone, so that
        round-off of a momentum at the limit is no event.
        """
        momentum = state.momentum
        if self.momentum_limit is None:
            return jnp.zeros(0, momentum.dtype)
        driven = wheel_motion.unlimited_torque(self, momentum, command) + self._drag(acceleration)
        growth = -driven * momentum / self.momentum_limit**2
        arrives = jnp.minimum((momentum / self.momentum_limit) ** 2 - 1, growth)
        return arrives if self.limited is None else jnp.where(self.limited, growth, arrives)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "Wheels":
        """Return these wheels, each at its momentum limit or not as `signs` gives."""
        if not self.event_count:
            return self
        return eqx.tree_at(lambda x: x.limited, self, signs, is_leaf=lambda x: x is None)

    def require_continuous(self) -> None:
        """Raise `ValueError` for Coulomb friction, initial or after a failure, and for a seized
        wheel that fails again."""
        wheel_failures.require_continuous(self)


def wheel_momentum(state: Any) -> Float[Array, "*cases wheels"] | None:
    """Return the momentum of each wheel in a plant's state, N m s; None without wheels."""
    own = state.find(WheelMomenta)
    return None if own is None else own.momentum
