"""What happens to a thruster in flight: failures as events at a time."""

import enum
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.checks import as_float


class FailureKind(enum.IntEnum):
    """How a thruster fails; `FailureEvents.amount` tells how much of it where that is needed."""

    DEAD = 0
    """It makes no thrust any more."""
    DEGRADED = 1
    """It makes `amount` of the thrust it should, between 0 and 1."""
    STUCK_ON = 2
    """Its valve stays open."""
    STUCK_AT = 3
    """It makes `amount` of its full thrust, whatever is commanded."""
    LEAKING = 4
    """It never makes less than `amount` of its full thrust."""
    DELAYED = 5
    """Its valve follows `amount` seconds later."""
    INTERMITTENT = 6
    """It makes no thrust for `amount` of every `CYCLE` seconds."""
    TURNED = 7
    """Its torque is turned by `turn`."""
    REVERSED = 8
    """It makes the opposite of the torque it should; one that has both signs."""


CYCLE = 10.0
"""s, in which an intermittent thruster works and fails."""


class AbstractFailures(eqx.Module):
    """F failures: of one actuator each, by its number from 0, `at` (s), of a `kind`, by an amount.

    The numbers are arrays, so that cases which differ in what fails, how and when share one
    program; that of the actuator and `kind` are rounded, which lets a study draw them. A time of
    infinity is never.
    """

    at: eqx.AbstractVar[Float[Array, " f"]]
    kind: eqx.AbstractVar[Float[Array, " f"]]
    amount: eqx.AbstractVar[Float[Array, " f"]]

    @property
    def count(self) -> int:
        """How many events there are."""
        return self.at.shape[0]


class FailureEvents(AbstractFailures):
    """Failures of thruster number `thruster`, of a `FailureKind`.

    `turned` (F, 3, m) are the torques (N m) of all thrusters as each event would turn them.
    """

    thruster: Float[Array, " f"] = eqx.field(converter=as_float)
    at: Float[Array, " f"] = eqx.field(converter=as_float)
    kind: Float[Array, " f"] = eqx.field(converter=as_float)
    amount: Float[Array, " f"] = eqx.field(converter=as_float)
    turned: Float[Array, "f 3 m"] = eqx.field(converter=as_float)

    def condition(
        self, t: Float[Array, ""], now: Float[Array, ""], torque: Float[Array, "3 m"]
    ) -> "Condition":
        """State of all thrusters `now` seconds after a sample at time `t` (s).

        Their torques in order are `torque`. Whether a valve is late, and whether an intermittent
        thruster works, is judged at the sample.
        """
        found = Condition.sound(torque)
        for event in range(self.count):
            begin = self.at[event] - t
            hit = jnp.arange(torque.shape[1]) == jnp.round(self.thruster[event])
            found = found.after(
                jnp.round(self.kind[event]),
                self.amount[event],
                self.turned[event],
                hit & (now >= begin),
                -begin,
            )
        return found

    def two_signed(
        self, struck: Bool[Array, " f"], axes: Float[Array, "3 m"]
    ) -> tuple[Float[Array, " m"], Float[Array, " m"], Float[Array, "3 m"]]:
        """State of thrusters of either sign once those events have struck.

        Their torque in parts of the limit is `gain` x commanded + `level`, along the third. They
        may be dead, degraded, stuck, turned or reversed.
        """
        gain, level = _two_signed(self, self.thruster, struck, axes.shape[1])
        for event in range(self.count):
            hit = (jnp.arange(gain.size) == jnp.round(self.thruster[event])) & struck[event]
            turns = hit & (jnp.round(self.kind[event]) == FailureKind.TURNED)
            axes = jnp.where(turns[None], self.turned[event], axes)
        return gain, level, axes


class MagnetorquerFailures(AbstractFailures):
    """Failures of magnetorquer number `magnetorquer`, of a `FailureKind`.

    They may be dead, degraded, stuck or reversed; `amount` is that of the kind, of the dipole limit
    from -1 to 1 where one is stuck.
    """

    magnetorquer: Float[Array, " f"] = eqx.field(converter=as_float)
    at: Float[Array, " f"] = eqx.field(converter=as_float)
    kind: Float[Array, " f"] = eqx.field(converter=as_float)
    amount: Float[Array, " f"] = eqx.field(converter=as_float)

    def two_signed(
        self, struck: Bool[Array, " f"], count: int
    ) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
        """State of so many magnetorquers: their dipole is `gain` x commanded + `level` x limit."""
        return _two_signed(self, self.magnetorquer, struck, count)


def _two_signed(
    events: FailureEvents | MagnetorquerFailures,
    struck_one: Float[Array, " f"],
    struck: Bool[Array, " f"],
    count: int,
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Gain and level of each of `count` actuators of either sign, of which events strike one."""
    gain = jnp.ones(count)
    level = jnp.zeros_like(gain)
    for event in range(events.count):
        hit = (jnp.arange(count) == jnp.round(struck_one[event])) & struck[event]
        kind, amount = jnp.round(events.kind[event]), events.amount[event]
        stuck = (kind == FailureKind.STUCK_ON) | (kind == FailureKind.STUCK_AT)
        held = jnp.where(kind == FailureKind.STUCK_ON, 1.0, amount)
        left = jnp.where(kind == FailureKind.DEGRADED, amount, 1.0)
        left = jnp.where(kind == FailureKind.REVERSED, -1.0, left)
        left = jnp.where(stuck | (kind == FailureKind.DEAD), 0.0, left)
        gain = jnp.where(hit, gain * left, gain)
        level = jnp.where(hit, jnp.where(stuck, held, left * level), level)
    return gain, level


class Condition(NamedTuple):
    """State of all thrusters: level = max(gain x commanded, floor), valves `delay` s late."""

    gain: Float[Array, " m"]
    floor: Float[Array, " m"]
    delay: Float[Array, " m"]
    torque: Float[Array, "3 m"]

    @staticmethod
    def sound(torque: Float[Array, "3 m"]) -> "Condition":
        """Nothing has failed."""
        one = jnp.ones(torque.shape[1])
        return Condition(one, 0 * one, 0 * one, torque)

    def after(self, kind, amount, turned, hit, since) -> "Condition":
        """With one more event, which hits some thrusters; `since` s later was the last sample."""
        within = since - CYCLE * jnp.floor(since / CYCLE)
        silent = (kind == FailureKind.DEAD) | (kind == FailureKind.STUCK_AT)
        silent = silent | ((kind == FailureKind.INTERMITTENT) & (within < amount * CYCLE))
        gain = jnp.where(silent, 0.0, jnp.where(kind == FailureKind.DEGRADED, amount, 1.0))
        held = (kind == FailureKind.STUCK_AT) | (kind == FailureKind.LEAKING)
        floor = jnp.where(kind == FailureKind.STUCK_ON, 1.0, jnp.where(held, amount, 0.0))
        late = jnp.where(kind == FailureKind.DELAYED, amount, 0.0)
        turns = hit & (kind == FailureKind.TURNED)
        return Condition(
            jnp.where(hit, self.gain * gain, self.gain),
            jnp.where(hit, jnp.maximum(self.floor, floor), self.floor),
            jnp.where(hit, self.delay + late, self.delay),
            jnp.where(turns[None], turned, self.torque),
        )
