"""Failures of reaction wheels in flight, as events at a time, and the remaining reach."""

from typing import TYPE_CHECKING, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import concrete
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.core.ranges import FRICTION
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.failures import AbstractFailures

if TYPE_CHECKING:
    from jaxsat.spacecraft.wheels import Wheels


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
        left = jnp.where(kind == WheelFailureKind.DEGRADED, amount, 1.0)
        return WheelCondition(
            jnp.where(silent, 0.0, left),
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


def driven(
    wheels: "Wheels",
    momentum: Float[Array, " wheels"],
    command: Float[Array, " wheels"],
    struck: Bool[Array, " f"],
) -> "tuple[Wheels, Float[Array, ' wheels']]":
    """Return wheels in the condition after their failures, and their motor torques, N m."""
    if wheels.failures is None:
        return wheels, command
    condition = wheels.failures.condition(struck, wheels.count)
    coulomb = jnp.zeros_like(momentum)
    if wheels.coulomb_friction is not None:
        coulomb = wheels.coulomb_friction
    coulomb = jnp.maximum(condition.friction * coulomb, condition.coulomb)
    viscous = wheels.viscous_friction
    if viscous is not None:
        viscous = condition.friction * viscous
    seized = None if wheels.rotor_inertia is None else condition.stopped
    after = eqx.tree_at(
        lambda one: (one.coulomb_friction, one.viscous_friction, one.failures, one.seized),
        wheels,
        (coulomb, viscous, None, seized),
        is_leaf=lambda x: x is None,
    )
    torque = condition.command(wheels.motor_torque(command), momentum, wheels.torque_limit)
    return after, torque


def reach(
    wheels: "Wheels", momentum: Float[Array, " wheels"], struck: Bool[Array, " f"], span: RealScalar
) -> Reach:
    """Return the reach: motor torques less friction, N m, in either direction of the wheel.

    They are bounded by the momentum's room for `span` seconds. A runaway wheel makes its full
    torque.
    """
    motor = jnp.full_like(momentum, jnp.inf)
    motor = motor if wheels.torque_limit is None else wheels.torque_limit
    condition = None
    after, full = driven(wheels, momentum, wheels.idle(), struck)[0], motor
    if wheels.failures is not None:
        condition = wheels.failures.condition(struck, wheels.count)
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
    if wheels.momentum_limit is not None:
        down = _for_span(wheels.momentum_limit - momentum, span)
        up = _for_span(wheels.momentum_limit + momentum, span)
        low, high = jnp.clip(low, -down, up), jnp.clip(high, -down, up)
    return Reach(wheels.axes, low, high)


def _for_span(room: Float[Array, " wheels"], span) -> Float[Array, " wheels"]:
    """Return the torque (N m) that uses up this room of momentum (N m s) in a time (s)."""
    room = jnp.maximum(room, 0.0)
    now = jnp.where(room > 0, jnp.inf, 0.0)
    return jnp.where(span > 0, room / jnp.where(span > 0, span, 1.0), now)


def require_continuous(wheels: "Wheels") -> None:
    """Raise `ValueError` for Coulomb friction, initial or after a failure, and for a seized wheel
    that fails again."""
    failures = wheels.failures
    kinds = None if failures is None else concrete(failures.kind)
    rubs = kinds is not None and np.any(np.rint(kinds) == WheelFailureKind.FRICTION_TO)
    if rubs or wheels.coulomb_friction is not None:
        raise ValueError(
            "Wheels with Coulomb friction must have a command that is held, which that of a "
            "continuous controller is not."
        )
    if failures is not None and failures.frees_a_wheel():
        raise ValueError(
            "A wheel that has seized must not fail once more under a continuous controller, "
            "whose state has no jump of the momentum that the body got."
        )
