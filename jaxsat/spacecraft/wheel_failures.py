"""What happens to a reaction wheel in flight: failures as events at a time."""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.core.checks import as_float, concrete
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.core.ranges import FRICTION
from jaxsat.spacecraft.failures import AbstractFailures


class WheelFailures(AbstractFailures):
    """Failures of wheel number `wheel`, of a `WheelFailureKind`."""

    part: ClassVar[str] = "wheel"
    kinds: ClassVar[type[AbstractFailureKind]] = WheelFailureKind

    wheel: Float[Array, " f"] = eqx.field(converter=as_float)
    at: Float[Array, " f"] = eqx.field(converter=as_float)
    kind: Float[Array, " f"] = eqx.field(converter=as_float)
    amount: Float[Array, " f"] = eqx.field(converter=as_float)

    def largest_amount(self) -> np.ndarray:
        """As much friction as a wheel may have, else all of its torque."""
        kinds = concrete(self.kind)
        if kinds is None:
            return super().largest_amount()
        friction = (WheelFailureKind.FRICTION_BY, WheelFailureKind.FRICTION_TO)
        return np.where(np.isin(np.rint(kinds), friction), FRICTION.high, 1.0)

    def condition(self, struck: Bool[Array, " f"], wheels: int) -> "WheelCondition":
        """State of so many wheels once those events have struck."""
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
        """Whether a wheel that has seized is struck once more, as far as the numbers are known."""
        known = [concrete(one) for one in (self.wheel, self.at, self.kind)]
        if any(one is None for one in known):
            return False
        events = sorted(zip(*map(np.asarray, known), strict=True), key=lambda one: one[1])
        events = [(round(wheel), at, round(kind)) for wheel, at, kind in events if np.isfinite(at)]
        stops = [one for one in events if one[2] == WheelFailureKind.STOPPED]
        return any(one[0] == other[0] and other[1] > one[1] for one in stops for other in events)


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
