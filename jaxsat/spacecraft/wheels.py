"""Reaction wheels: their torque, and the edges at which momenta reach a limit or zero.

A wheel's momentum h is relative to the body, and the inertia of the spacecraft includes its locked
wheels. A motor with a commanded torque c turns the body by c and the wheel by -c; viscous and
Coulomb friction b and τ brake the wheel and drag the body along. A rotor with the inertia J_w
about its axis a also lags behind an accelerating body:

    dh/dt = -(c + b h / J_w + τ sign h) - J_w a·dω/dt

At its limit a wheel takes no torque that would raise its momentum further. The mode is the set of
held wheels: `jaxsat.spacecraft.wheel_motion`; `held_wheels` has its changes in closed form where
they do not depend on the body.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import Vector
from jaxsat.core.checks import as_float, concrete, require_finite, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.core.ranges import TORQUE
from jaxsat.spacecraft.axes import of_each, unit_axes
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import Effect, EffectorContext, Storage
from jaxsat.spacecraft.wheel_failures import AbstractFailingWheels, WheelFailures
from jaxsat.spacecraft.wheel_motion import WheelMomenta, WheelPiece

OfEach = ArrayLike | list | tuple | None
"""One number, one for each wheel, or None."""


def _momentum_limits(one: "Wheels") -> Limits:
    """Return the limits of drawn momenta: each wheel's momentum limit, at most `TORQUE.high`."""
    limit = as_float(TORQUE.high) if one.momentum_limit is None else one.momentum_limit
    largest = jnp.minimum(limit, TORQUE.high)
    return Limits(-largest, largest)


class Wheels(AbstractFailingWheels):
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

    def effect(self, piece: WheelPiece, t, plant, state: WheelMomenta) -> Effect:
        """Return the torque A c (N m), and the correction -Σ J_w a aᵀ (kg m²) of turning wheels."""
        return Effect(self.axes @ piece.torque(state.momentum), self.free_inertia(piece.turns))

    def derivative(
        self, piece: WheelPiece, plant, state: WheelMomenta, acceleration
    ) -> WheelMomenta:
        """Return dh/dt = -c - J_w aᵀdω/dt of turning wheels, N m."""
        return WheelMomenta(self._rate(piece, state, acceleration))

    def axis_torque(
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
        return self.axes @ self.axis_torque(piece, state, acceleration)

    def signals(self, piece: WheelPiece, state: WheelMomenta, acceleration) -> dict[str, Array]:
        """Return the torque of each wheel (N m), by the name of its signal."""
        return {"wheel_torque": self.axis_torque(piece, state, acceleration)}

    def stored(self, state: WheelMomenta) -> dict[str, Array]:
        """Return the momentum of each wheel (N m s), by the name of its signal."""
        return {"wheel_momentum": state.momentum}

    def flight_commands(self, use, memory, period) -> tuple[dict[str, Array], PyTree]:
        """Return the torque of each motor on the body, N m, by the name of its flight command."""
        return {"wheel_torque": use}, memory

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
        torque = self.unlimited_torque(momentum, command) + self._drag(acceleration)
        growth = -torque * momentum / self.momentum_limit**2
        arrives = jnp.minimum((momentum / self.momentum_limit) ** 2 - 1, growth)
        return arrives if self.limited is None else jnp.where(self.limited, growth, arrives)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "Wheels":
        """Return these wheels, each at its momentum limit or not as `signs` gives."""
        if not self.event_count:
            return self
        return eqx.tree_at(lambda x: x.limited, self, signs, is_leaf=lambda x: x is None)


def wheel_momentum(state: Any) -> Float[Array, "*cases wheels"] | None:
    """Return the momentum of each wheel in a plant's state, N m s; None without wheels."""
    own = state.find(WheelMomenta)
    return None if own is None else own.momentum
