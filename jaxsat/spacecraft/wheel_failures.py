"""Failures of reaction wheels in flight, as events at a time, and the remaining reach."""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import concrete
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.core.ranges import FRICTION
from jaxsat.spacecraft.effector import Effect, Reach
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.held_wheels import AbstractHeldWheels
from jaxsat.spacecraft.wheel_motion import WheelMomenta


class WheelFailures(AbstractFailures):
    """Failures of wheels, of a `WheelFailureKind`."""

    part: ClassVar[str] = "wheel"
    kinds: ClassVar[type[AbstractFailureKind]] = WheelFailureKind

    def largest_amount(self) -> np.ndarray:
        """Return the largest amount of each failure: of friction its range's upper end, else 1."""
        kinds = concrete(self.kind)
        if kinds is None:
            return super().largest_amount()
        friction = (WheelFailureKind.FRICTION_BY, WheelFailureKind.FRICTION_TO)
        return np.where(np.isin(np.rint(kinds), friction), FRICTION.high, 1.0)

    def condition(self, struck: Bool[Array, " f"], wheels: int) -> "WheelCondition":
        """Return the condition of `wheels` wheels after the failures that have struck."""
        last = self.last(struck, wheels)
        kind, amount = last.kind, last.amount
        silent = (kind == WheelFailureKind.DEAD) | (kind == WheelFailureKind.STOPPED)
        gain = jnp.where(kind == WheelFailureKind.DEGRADED, amount, 1.0)
        return WheelCondition(
            jnp.where(silent, 0.0, gain),
            jnp.where(kind == WheelFailureKind.FRICTION_BY, amount, 1.0),
            jnp.where(kind == WheelFailureKind.FRICTION_TO, amount, 0.0),
            kind == WheelFailureKind.RUNAWAY,
            kind == WheelFailureKind.STOPPED,
        )

    def frees_a_wheel(self) -> bool:
        """Whether a later failure strikes a seized wheel, as far as the numbers are concrete."""
        columns = [concrete(one) for one in (self.number, self.at, self.kind)]
        if any(one is None for one in columns):
            return False
        events = sorted(zip(*map(np.asarray, columns), strict=True), key=lambda one: one[1])
        events = [(round(wheel), at, round(kind)) for wheel, at, kind in events if np.isfinite(at)]
        stops = [one for one in events if one[2] == WheelFailureKind.STOPPED]
        return any(one[0] == other[0] and other[1] > one[1] for one in stops for other in events)


class WheelCondition(NamedTuple):
    """Condition of all wheels: motor torque = `gain` x commanded, or its limit in a `runaway`.

    Friction is multiplied by `friction`, and Coulomb friction is at least `coulomb` N m; a wheel
    that has `stopped` does not turn.
    """

    gain: Float[Array, " wheels"]
    friction: Float[Array, " wheels"]
    coulomb: Float[Array, " wheels"]
    runaway: Bool[Array, " wheels"]
    stopped: Bool[Array, " wheels"]

    def command(
        self,
        torque: Float[Array, " wheels"],
        momentum: Float[Array, " wheels"],
        limit: Float[Array, " wheels"] | None,
    ) -> Float[Array, " wheels"]:
        """Return the motor torques for a commanded `torque` within their `limit` (N m)."""
        if limit is not None:
            full = jnp.where(momentum < 0, limit, -limit)
            torque = jnp.where(self.runaway, full, torque)
        return self.gain * torque


class AbstractFailingWheels(AbstractHeldWheels):
    """Wheels that may fail in flight: their blows, conditions and reach."""

    failures: eqx.AbstractVar[WheelFailures | None]

    def _stopped(self, struck: Bool[Array, " f"]) -> Bool[Array, " wheels"]:
        if self.failures is None:
            return jnp.zeros(self.count, bool)
        return self.failures.condition(struck, self.count).stopped

    def blow(self, state: WheelMomenta, struck: Bool[Array, " f"]) -> Effect:
        """Return the impulse of seizing wheels (N m s), and the correction by other rotors."""
        stopped = self._stopped(struck)
        impulse = self.axes @ jnp.where(stopped, state.momentum, 0.0)
        return Effect(impulse, self.free_inertia(~stopped))

    def blown(self, state: WheelMomenta, struck: Bool[Array, " f"], change) -> WheelMomenta:
        """Return the state after a blow: seized wheels at rest, J_w aᵀω + h of others unchanged."""
        momentum = state.momentum
        if self.rotor_inertia is not None:
            momentum = momentum - self._drag(change)
        return WheelMomenta(jnp.where(self._stopped(struck), 0.0, momentum))

    def driven(
        self, state: WheelMomenta, command: Float[Array, " wheels"], struck: Bool[Array, " f"]
    ) -> "tuple[AbstractFailingWheels, Float[Array, ' wheels']]":
        """Return wheels in the condition after their failures, and their motor torques, N m."""
        if self.failures is None:
            return self, command
        condition = self.failures.condition(struck, self.count)
        coulomb = jnp.zeros_like(state.momentum)
        if self.coulomb_friction is not None:
            coulomb = self.coulomb_friction
        coulomb = jnp.maximum(condition.friction * coulomb, condition.coulomb)
        viscous = self.viscous_friction
        if viscous is not None:
            viscous = condition.friction * viscous
        seized = None if self.rotor_inertia is None else condition.stopped
        after = eqx.tree_at(
            lambda one: (one.coulomb_friction, one.viscous_friction, one.failures, one.seized),
            self,
            (coulomb, viscous, None, seized),
            is_leaf=lambda x: x is None,
        )
        torque = condition.command(self.motor_torque(command), state.momentum, self.torque_limit)
        return after, torque

    def reach(self, t, plant, state: WheelMomenta, struck, span: RealScalar) -> Reach:
        """Return the reach: motor torques less friction, N m, in either direction of the wheel.

        They are bounded by the momentum's room for `span` seconds. A runaway wheel makes its full
        torque.
        """
        momentum = state.momentum
        motor = jnp.full_like(momentum, jnp.inf)
        motor = motor if self.torque_limit is None else self.torque_limit
        condition = None
        after, full = self.driven(state, self.idle(), struck)[0], motor
        if self.failures is not None:
            condition = self.failures.condition(struck, self.count)
            motor = jnp.where(condition.gain > 0, condition.gain * full, 0.0)
        friction = after.decay * jnp.abs(momentum)
        if after.coulomb_friction is not None:
            friction = friction + after.coulomb_friction
        high = jnp.maximum(motor - friction, 0.0)
        low = -high
        if condition is not None:
            away = jnp.where(momentum < 0, full, -full)
            low = jnp.where(condition.runaway, away, low)
            high = jnp.where(condition.runaway, away, high)
        if self.momentum_limit is not None:
            down = _for_span(self.momentum_limit - momentum, span)
            up = _for_span(self.momentum_limit + momentum, span)
            low, high = jnp.clip(low, -down, up), jnp.clip(high, -down, up)
        return Reach(self.axes, low, high)

    def last_drawn_kind(self, sampled: bool) -> WheelFailureKind:
        """Return the last kind that a study draws: `RUNAWAY` only if all wheels have a torque
        limit, and `FRICTION_TO`, the one before, only under a sampled law."""
        if not sampled:
            return WheelFailureKind.FRICTION_BY
        limits = None if self.torque_limit is None else concrete(self.torque_limit)
        limited = limits is not None and bool(np.all(np.isfinite(limits)))
        return WheelFailureKind.RUNAWAY if limited else WheelFailureKind.FRICTION_TO

    def without_corners(self) -> "AbstractFailingWheels":
        """Return the same wheels without Coulomb friction and failures in flight."""
        return eqx.tree_at(
            lambda one: (one.coulomb_friction, one.failures),
            self,
            (None, None),
            is_leaf=lambda x: x is None or isinstance(x, WheelFailures),
        )

    def require_continuous(self) -> None:
        """Raise `ValueError` for Coulomb friction, initial or after a failure, and for a seized
        wheel that fails again."""
        failures = self.failures
        kinds = None if failures is None else concrete(failures.kind)
        rubs = kinds is not None and np.any(np.rint(kinds) == WheelFailureKind.FRICTION_TO)
        if rubs or self.coulomb_friction is not None:
            raise ValueError(
                "Wheels with Coulomb friction must have a command that is held, which that of a "
                "continuous controller is not."
            )
        if failures is not None and failures.frees_a_wheel():
            raise ValueError(
                "A wheel that has seized must not fail once more under a continuous controller, "
                "whose state has no jump of the momentum that the body got."
            )


def _for_span(room: Float[Array, " wheels"], span) -> Float[Array, " wheels"]:
    """Return the torque (N m) that uses up this room of momentum (N m s) in a time (s)."""
    room = jnp.maximum(room, 0.0)
    now = jnp.where(room > 0, jnp.inf, 0.0)
    return jnp.where(span > 0, room / jnp.where(span > 0, span, 1.0), now)
