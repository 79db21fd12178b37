"""What happens to a reaction wheel in flight: failures as events at a time."""

import enum
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.checks import as_float
from jaxsat.vehicle.failures import AbstractFailures


class WheelFailureKind(enum.IntEnum):
    """How a wheel fails; `WheelFailures.amount` tells how much of it where that is needed."""

    DEAD = 0
    """Its motor makes no torque any more; it coasts."""
    DEGRADED = 1
    """Its motor makes `amount` of the torque it should, between 0 and 1."""
    STOPPED = 2
    """Its bearing seizes: at once it stands still, and the body has its momentum."""
    FRICTION_BY = 3
    """Its viscous and Coulomb friction are `amount` times as large."""
    FRICTION_TO = 4
    """Its Coulomb friction is `amount` N m, if it was less."""
    RUNAWAY = 5
    """Its motor makes its full torque, the way that it turns (the positive one from rest)."""


class WheelFailures(AbstractFailures):
    """Failures of wheel number `wheel`, of a `WheelFailureKind`."""

    wheel: Float[Array, " f"] = eqx.field(converter=as_float)
    at: Float[Array, " f"] = eqx.field(converter=as_float)
    kind: Float[Array, " f"] = eqx.field(converter=as_float)
    amount: Float[Array, " f"] = eqx.field(converter=as_float)

    def condition(self, struck: Bool[Array, " f"], wheels: int) -> "WheelCondition":
        """State of so many wheels once those events have struck."""
        found = WheelCondition.sound(wheels)
        for event in range(self.count):
            hit = jnp.arange(wheels) == jnp.round(self.wheel[event])
            kind = jnp.round(self.kind[event])
            found = found.after(kind, self.amount[event], hit & struck[event])
        return found


class WheelCondition(NamedTuple):
    """State of all wheels: motor torque = `gain` x commanded, or its full one in a `runaway`.

    Friction is `friction` times what it was, and Coulomb friction at least `coulomb` N m; a wheel
    that has `stopped` does not turn.
    """

    gain: Float[Array, " wheels"]
    friction: Float[Array, " wheels"]
    coulomb: Float[Array, " wheels"]
    runaway: Bool[Array, " wheels"]
    stopped: Bool[Array, " wheels"]

    @staticmethod
    def sound(wheels: int) -> "WheelCondition":
        """Nothing has failed."""
        one, never = jnp.ones(wheels), jnp.zeros(wheels, bool)
        return WheelCondition(one, one, 0 * one, never, never)

    def after(self, kind, amount, hit) -> "WheelCondition":
        """With one more event, which hits some wheels."""
        silent = (kind == WheelFailureKind.DEAD) | (kind == WheelFailureKind.STOPPED)
        gain = jnp.where(kind == WheelFailureKind.DEGRADED, amount, jnp.where(silent, 0.0, 1.0))
        more = jnp.where(kind == WheelFailureKind.FRICTION_BY, amount, 1.0)
        least = jnp.where(kind == WheelFailureKind.FRICTION_TO, amount, 0.0)
        return WheelCondition(
            jnp.where(hit, self.gain * gain, self.gain),
            jnp.where(hit, self.friction * more, self.friction),
            jnp.where(hit, jnp.maximum(self.coulomb, least), self.coulomb),
            self.runaway | (hit & (kind == WheelFailureKind.RUNAWAY)),
            self.stopped | (hit & (kind == WheelFailureKind.STOPPED)),
        )

    def command(
        self,
        asked: Float[Array, " wheels"],
        momentum: Float[Array, " wheels"],
        limit: Float[Array, " wheels"] | None,
    ) -> Float[Array, " wheels"]:
        """The torque that motors make of what is `asked`, within their `limit` (N m) before."""
        if limit is not None:
            full = jnp.where(momentum < 0, limit, -limit)
            asked = jnp.where(self.runaway, full, asked)
        return self.gain * asked
