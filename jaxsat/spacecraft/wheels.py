"""Reaction wheels: what torque they make, and when their momenta meet a limit or zero.

A wheel's momentum h is that relative to the body, and the inertia of the spacecraft is the one with
its wheels locked. A motor that is commanded a torque c turns the body by c and the wheel by -c;
viscous and Coulomb friction b and τ brake the wheel and take the body along. A rotor with the
inertia J_w about its axis a also stays behind where the body turns faster:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

At its limit a wheel takes no torque that would raise its momentum further. Which wheels are held is
their mode; `jaxsat.spacecraft.wheel_motion` has it, and in closed form when that changes where it
does not depend on the body.
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
"""How often it is asked which wheels are held, each time with the rates that this gives."""


class WheelMomenta(eqx.Module):
    """The state of wheels: the momentum of each relative to the body, N m s."""

    momentum: Float[Array, " wheels"] = eqx.field(converter=as_float)


def _momentum_limits(one: "Wheels") -> Limits:
    """The limits of momenta: that of each wheel which has one."""
    limit = as_float(TORQUE.high) if one.momentum_limit is None else one.momentum_limit
    largest = jnp.minimum(limit, TORQUE.high)
    return Limits(-largest, largest)


class Wheels(AbstractEffector):
    """Reaction wheels along any axes, of shape (3, wheels) in body axes, scaled to unit length.

    `torque_limit` (N m) bounds each motor's torque and `momentum_limit` (N m s) each momentum.
    `rotor_inertia` (kg m²) is that of each rotor about its axis, part of the spacecraft's inertia.
    `viscous_friction` (N m s/rad), which needs it, and `coulomb_friction` (N m) brake the rotors.
    Each is one number, or one for each wheel, and None for none. `failures` strike them in flight.
    `limited` holds each wheel at its momentum limit or off it, see `smooth_piece`, `seized` those
    at rest that have seized. Raises `ValueError` for numbers that no wheel has.
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
        """The wheels of checked tables `[[wheel]]` of a scenario, and their momenta at the start.

        What none of them has is left out.
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
        """How many wheels there are."""
        return self.axes.shape[1]

    def rotors(self, turns: Bool[Array, " wheels"] | None = None) -> Matrix:
        """Σ J_w a aᵀ (kg m²) over the wheels that turn, by default all: their part of the body."""
        if self.rotor_inertia is None:
            return jnp.zeros((3, 3))
        inertia = self.rotor_inertia if turns is None else jnp.where(turns, self.rotor_inertia, 0.0)
        return self.axes @ (inertia[:, None] * self.axes.T)

    @property
    def decay(self) -> Float[Array, " wheels"]:
        """b / J_w: the part of a momentum that viscous friction takes a second, 1/s."""
        if self.viscous_friction is None or self.rotor_inertia is None:
            return jnp.zeros(self.count)
        inertia = jnp.where(self.rotor_inertia > 0, self.rotor_inertia, 1.0)
        return self.viscous_friction / inertia

    def motor_torque(self, command: Float[Array, " wheels"]) -> Float[Array, " wheels"]:
        """The torque that motors make on a command, N m, without friction and momentum limit."""
        if self.torque_limit is None:
            return command
        return jnp.clip(command, -self.torque_limit, self.torque_limit)

    def _drag(self, acceleration: Vector) -> Float[Array, " wheels"]:
        """J_w a·dω/dt of each wheel, N m."""
        if self.rotor_inertia is None:
            return jnp.zeros(self.count, acceleration.dtype)
        return self.rotor_inertia * (self.axes.T @ acceleration)

    # State, effect and derivative.

    def init(self) -> WheelMomenta:
        """The state at the start: all wheels stand still."""
        return WheelMomenta(jnp.zeros(self.count))

    def with_momenta(self, state: WheelMomenta, change) -> WheelMomenta:
        """The state with each wheel's momentum changed."""
        return WheelMomenta(change(state.momentum))

    def momentum(self, state: WheelMomenta) -> Vector:
        """The momentum of all wheels relative to the body, A h in body axes, N m s."""
        return self.axes @ state.momentum

    def storage(self) -> Storage:
        """The inertia of each rotor, and the momentum limit of each wheel."""
        rotors, most = self.rotor_inertia, self.momentum_limit
        return Storage(
            jnp.zeros(self.count) if rotors is None else rotors,
            jnp.full(self.count, jnp.inf) if most is None else most,
        )

    def free_inertia(self) -> Matrix | None:
        """The correction of the inertia by all wheels, -Σ J_w a aᵀ, kg m²."""
        return self._correction(None)

    def _correction(self, turns: Bool[Array, " wheels"] | None) -> Matrix | None:
        return None if self.rotor_inertia is None else -self.rotors(turns)

    @property
    def mode_passes(self) -> int:
        """How often `mode_after` is called: never where `limited` says which wheels are held."""
        if self.limited is not None:
            return 0
        return 1 if self.rotor_inertia is None else STATE_PASSES

    def mode(self, state: WheelMomenta) -> WheelStates:
        """How wheels move by their momenta alone: those that may be held are."""
        return first_states(self, state.momentum)

    def mode_after(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> WheelStates:
        """How wheels move once those have left their state of which a margin is below zero."""
        if self.limited is not None:
            return mode
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.left(mode.margins(self, state.momentum, drive, drag), drive, drag)

    def piece(self, mode: WheelStates, command: Float[Array, " wheels"]) -> WheelPiece:
        """The drive and decay of each wheel, and which of them turn."""
        return mode.piece(self, self.motor_torque(command))

    def effect(self, piece: WheelPiece, t, plant, state: WheelMomenta) -> Effect:
        """The torque A c (N m), and the correction -Σ J_w a aᵀ (kg m²) of the wheels that turn."""
        return Effect(self.axes @ piece.torque(state.momentum), self._correction(piece.turns))

    def derivative(
        self, piece: WheelPiece, plant, state: WheelMomenta, acceleration
    ) -> WheelMomenta:
        """dh/dt = -c - J_w aᵀdω/dt of the wheels that turn, N m."""
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
        """What each wheel does to the body along its axis, N m.

        Of one that keeps its momentum it is what turns its rotor with the body.
        """
        torque = piece.torque(state.momentum)
        if piece.turns is None or self.rotor_inertia is None:
            return torque
        return jnp.where(piece.turns, torque, -self._drag(acceleration))

    def torque(self, piece: WheelPiece, t, plant, state: WheelMomenta, acceleration):
        """The torque A c with what turns rotors that keep their momentum, N m."""
        return self.axes @ self.made(piece, state, acceleration)

    def signals(self, piece: WheelPiece, state: WheelMomenta, acceleration) -> dict[str, Array]:
        """The torque of each wheel (N m), by the name of its signal."""
        return {"wheel_torque": self.made(piece, state, acceleration)}

    def stored(self, state: WheelMomenta) -> dict[str, Array]:
        """The momentum of each wheel (N m s), by the name of its signal."""
        return {"wheel_momentum": state.momentum}

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """The torque of each motor on the body, N m."""
        return {"wheel_torque": use}, memory

    # Failures in flight.

    def _stopped(self, struck: Bool[Array, " f"]) -> Bool[Array, " wheels"]:
        if self.failures is None:
            return jnp.zeros(self.count, bool)
        return self.failures.condition(struck, self.count).stopped

    def blow(self, state: WheelMomenta, struck: Bool[Array, " f"]) -> Effect:
        """The impulse of wheels that seize (N m s), and the inertia of the rotors that turn on."""
        stopped = self._stopped(struck)
        impulse = self.axes @ jnp.where(stopped, state.momentum, 0.0)
        return Effect(impulse, self._correction(~stopped))

    def blown(self, state: WheelMomenta, struck: Bool[Array, " f"], change) -> WheelMomenta:
        """The state after a blow: those that seize stand still, and J_w aᵀω + h of others stays."""
        momentum = state.momentum
        if self.rotor_inertia is not None:
            momentum = momentum - self._drag(change)
        return WheelMomenta(jnp.where(self._stopped(struck), 0.0, momentum))

    def driven(
        self, state: WheelMomenta, command: Float[Array, " wheels"], struck: Bool[Array, " f"]
    ) -> "tuple[Wheels, Float[Array, ' wheels']]":
        """Wheels that fail no more but are in their condition, and what their motors make, N m."""
        return wheel_failures.driven(self, state.momentum, command, struck)

    def reach(self, t, plant, state: WheelMomenta, struck, span) -> Reach:
        """The torque of each motor that friction leaves, N m, whichever way the wheel turns."""
        return wheel_failures.reach(self, state.momentum, struck, span)

    def last_drawn_kind(self, sampled: bool) -> WheelFailureKind:
        """The last kind that a study draws: `RUNAWAY` only where all have a torque limit, and
        `FRICTION_TO`, the one before, only under a sampled law."""
        if not sampled:
            return WheelFailureKind.FRICTION_BY
        limits = None if self.torque_limit is None else concrete(self.torque_limit)
        limited = limits is not None and bool(np.all(np.isfinite(limits)))
        return WheelFailureKind.RUNAWAY if limited else WheelFailureKind.FRICTION_TO

    def without_corners(self) -> "Wheels":
        """The same wheels without Coulomb friction and failures in flight."""
        return eqx.tree_at(
            lambda one: (one.coulomb_friction, one.failures),
            self,
            (None, None),
            is_leaf=lambda x: x is None or isinstance(x, WheelFailures),
        )

    # A held command: edges, and the piece between two of them.

    @property
    def edge_count(self) -> int:
        """How many edges there are: one a wheel that friction may stop, and one a wheel with a
        limit."""
        return self.count * sum(x is not None for x in (self.coulomb_friction, self.momentum_limit))

    @property
    def follows_body(self) -> bool:
        """Whether edges must be searched: where rotors have an inertia and wheels may be held."""
        holds = self.edge_count > 0 or self.seized is not None
        return self.rotor_inertia is not None and holds

    def edges(self, state: WheelMomenta, command, period) -> Float[Array, " edges"]:
        """The instants (s) at which wheels come to rest or to their limits."""
        return wheel_motion.edges_of(self, state.momentum, command, period)

    def held_piece(self, state: WheelMomenta, command, elapsed) -> WheelPiece:
        """The piece after `elapsed` s, while the body turns evenly or without a rotor inertia."""
        return wheel_motion.piece_after(self, state.momentum, command, elapsed)

    def snapped(self, state: WheelMomenta, command, elapsed, reached: WheelMomenta) -> WheelMomenta:
        """The state with momenta exactly zero, or at the limit, where wheels come to it then."""
        momentum = state.momentum
        return WheelMomenta(
            wheel_motion.snapped(self, momentum, command, elapsed, reached.momentum)
        )

    def margins(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """How far wheels are from leaving rest or a hold, and from their momentum limit."""
        drive, drag = self.motor_torque(command), self._drag(acceleration)
        return mode.margins(self, state.momentum, drive, drag)

    def approach(
        self, mode: WheelStates, state: WheelMomenta, command, acceleration
    ) -> Float[Array, "2 wheels"]:
        """How fast margins of turning wheels change: where one breaks loose nothing jumps."""
        rate = self._rate(self.piece(mode, command), state, acceleration)
        speeds = jnp.stack([mode.side * rate, -jnp.sign(state.momentum) * rate])
        return jnp.where(mode.turns[None], speeds, 0.0)

    def come(self, mode: WheelStates, state: WheelMomenta, margins) -> WheelMomenta:
        """The state with momenta exactly zero, or at the limit, where wheels have come to it."""
        return WheelMomenta(mode.snapped(self, state.momentum, margins))

    # A command that changes continuously: events, and the smooth piece between two of them.

    @property
    def event_count(self) -> int:
        """How many corners there are: one for each wheel with a momentum limit."""
        return 0 if self.momentum_limit is None else self.count

    def event_functions(self, state: WheelMomenta, command, acceleration) -> Float[Array, " m"]:
        """Positive for each wheel that is held at its limit.

        A wheel comes to it by its momentum and leaves it by what drives it alone, so that rounding
        of a momentum at the limit is no event.
        """
        momentum = state.momentum
        if self.momentum_limit is None:
            return jnp.zeros(0, momentum.dtype)
        driven = wheel_motion.unlimited_torque(self, momentum, command) + self._drag(acceleration)
        growth = -driven * momentum / self.momentum_limit**2
        arrives = jnp.minimum((momentum / self.momentum_limit) ** 2 - 1, growth)
        return arrives if self.limited is None else jnp.where(self.limited, growth, arrives)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "Wheels":
        """These wheels, at their momentum limits or not as given."""
        if not self.event_count:
            return self
        return eqx.tree_at(lambda x: x.limited, self, signs, is_leaf=lambda x: x is None)

    def require_continuous(self) -> None:
        """Raise `ValueError` for Coulomb friction, at once or after a failure, and for a wheel that
        has seized and fails once more."""
        wheel_failures.require_continuous(self)


def wheel_momentum(state: Any) -> Float[Array, "*cases wheels"] | None:
    """The momentum of each wheel in a state of the plant, N m s; None where it has no wheels."""
    own = state.find(WheelMomenta)
    return None if own is None else own.momentum
