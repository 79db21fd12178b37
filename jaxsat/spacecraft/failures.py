"""Failures of thrusters in flight, as events at a time."""

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float, as_optional_float
from jaxsat.core.declaration.failures import ONE_WAY, AbstractFailureKind, FailureKind, failure_kind

CYCLE = 10.0
"""Period in which an intermittent thruster works and fails, s."""

SOUND = -1.0
"""Number in place of a failure kind for an actuator without a failure."""


class LastFailure(NamedTuple):
    """The last event that struck each of m actuators: its index `event` among all (-1 for none),
    its `kind` (`SOUND` for none), its `amount`, and its time `since` (s)."""

    event: Float[Array, " m"]
    kind: Float[Array, " m"]
    amount: Float[Array, " m"]
    since: Float[Array, " m"]

    def two_signed(self) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
        """Return gain and level of each two-sided actuator."""
        kind, amount = self.kind, self.amount
        stuck = (kind == FailureKind.STUCK_ON) | (kind == FailureKind.STUCK_AT)
        level = jnp.where(kind == FailureKind.STUCK_ON, 1.0, amount)
        gain = jnp.where(kind == FailureKind.DEGRADED, amount, 1.0)
        gain = jnp.where(kind == FailureKind.REVERSED, -1.0, gain)
        gain = jnp.where(stuck | (kind == FailureKind.DEAD), 0.0, gain)
        return gain, jnp.where(stuck, level, 0.0)


class AbstractFailures(eqx.Module):
    """F failures: of actuator `number` each, from 0, `at` (s), of a `kind`, by an `amount`.

    They act in the order of their times, and each replaces the previous failure of its actuator;
    among simultaneous ones the last acts. The numbers are arrays, so that cases with different
    failed actuators, kinds and times share one program; `number` and `kind` are rounded, so that a
    study can draw them. A time of infinity means never.
    """

    part: ClassVar[str]
    """Name of the failed part in tables."""

    kinds: ClassVar[type[AbstractFailureKind]]
    """Enumeration of the kinds of failure."""

    number: Float[Array, " f"] = eqx.field(converter=as_float)
    at: Float[Array, " f"] = eqx.field(converter=as_float)
    kind: Float[Array, " f"] = eqx.field(converter=as_float)
    amount: Float[Array, " f"] = eqx.field(converter=as_float)

    def largest_amount(self) -> np.ndarray:
        """Return the largest amount of each failure that a study may draw: here 1."""
        return np.ones(self.count)

    @classmethod
    def of_tables(cls, failures: Sequence[tuple[int, Any]]) -> Any:
        """Return the failures of `EffectorContext.failures`; None without any."""
        return cls(*cls.columns_of(failures)) if failures else None

    @classmethod
    def columns_of(cls, failures: Sequence[tuple[int, Any]]) -> tuple[list, list, list, list]:
        """Return number, time, kind and amount of each of `EffectorContext.failures`."""
        kind = [failure_kind(cls.kinds, table) for _, table in failures]
        number, at = [number for number, _ in failures], [table.at_s for _, table in failures]
        amount = [one.amount(table) for one, (_, table) in zip(kind, failures, strict=True)]
        return number, at, kind, amount

    @property
    def count(self) -> int:
        """Number of events."""
        return self.at.shape[0]

    def hit(self, event: int, count: int) -> Bool[Array, " m"]:
        """Whether an event strikes each of `count` actuators."""
        return jnp.arange(count, dtype=self.number.dtype) == jnp.round(self.number[event])

    def last(self, struck: Bool[Array, " f *own"], count: int) -> LastFailure:
        """Return the last failure of each of `count` actuators among those that have struck.

        `struck` may differ between actuators, as (f, m).
        """
        none = jnp.full(count, SOUND)
        latest = LastFailure(none, none, 0 * none, none - jnp.inf)
        for event in range(self.count):
            newer = self.hit(event, count) & struck[event] & (self.at[event] >= latest.since)
            this = (float(event), jnp.round(self.kind[event]), self.amount[event], self.at[event])
            latest = LastFailure(*map(lambda new, old: jnp.where(newer, new, old), this, latest))
        return latest


class FailureEvents(AbstractFailures):
    """Failures of thrusters, of a `FailureKind`.

    `turned` (F, 3, m) are the torques (N m) of all thrusters after each event of the kind `TURNED`.
    `partner` (m,) is, for each direction of a two-sided thruster, the number of the other
    direction, and for other thrusters their own; None without two-sided thrusters. An event
    strikes both directions but for the kinds `ONE_WAY`.
    """

    part: ClassVar[str] = "thruster"
    kinds: ClassVar[type[AbstractFailureKind]] = FailureKind

    turned: Float[Array, "f 3 m"] = eqx.field(converter=as_float)
    partner: Float[Array, " m"] | None = eqx.field(converter=as_optional_float, default=None)

    def of_others(
        self, nominal: Float[Array, "3 m"], others: Float[Array, "3 m"]
    ) -> "FailureEvents":
        """Return the failures of thrusters with `others` in place of `nominal` torques (N m).

        The same rotation and factor change the torque of each after it has turned.
        """
        sizes = [jnp.sqrt(jnp.sum(one**2, axis=0)) for one in (nominal, others)]
        old, new = (
            torque / jnp.where(size > 0, size, 1.0)[None]
            for torque, size in zip((nominal, others), sizes, strict=True)
        )
        turn, cosine = jnp.cross(old, new, axis=0), jnp.sum(old * new, axis=0)
        once = jnp.cross(turn[None], self.turned, axis=1)
        twice = jnp.cross(turn[None], once, axis=1)
        turned = self.turned + once + twice / (1 + cosine)[None, None]
        turned = turned * (sizes[1] / jnp.where(sizes[0] > 0, sizes[0], 1.0))[None, None]
        return eqx.tree_at(lambda one: one.turned, self, turned)

    def hit(self, event: int, count: int) -> Bool[Array, " m"]:
        """Whether an event strikes each thruster; two-sided ones count as two."""
        one = super().hit(event, count)
        if self.partner is None:
            return one
        kind = jnp.round(self.kind[event])
        both = (kind < min(ONE_WAY)) | (kind > max(ONE_WAY))
        return one | ((self.partner == jnp.round(self.number[event])) & both)

    def condition(
        self, t: RealScalar, now: RealScalar, torque: Float[Array, "3 m"]
    ) -> "ThrusterCondition":
        """Return the state of all thrusters `now` seconds after a sample at time `t` (s).

        `torque` are their sound torques. Delays of valves and pauses of intermittent thrusters are
        evaluated at the sample.
        """
        last = self.last(now >= self.at - t, torque.shape[1])
        return self._condition(last, torque, _paused(last, t))

    def opens(self, t: RealScalar, on: Float[Array, " m"]) -> Bool[Array, " m"]:
        """Whether valves open that are commanded `on` seconds after a sample at time `t` (s).

        Valves of dead, stuck, and pausing intermittent thrusters do not open.
        """
        last = self.last(on[None] >= (self.at - t)[:, None], on.shape[0])
        shut_or_stuck = [FailureKind.DEAD, FailureKind.STUCK_ON, FailureKind.STUCK_AT]
        still = [last.kind == kind for kind in shut_or_stuck]
        return ~(still[0] | still[1] | still[2] | _paused(last, t))

    def at_work(
        self, struck: Bool[Array, " f"], torque: Float[Array, "3 m"]
    ) -> "ThrusterCondition":
        """Return the state of all thrusters after the failures that have struck, without pauses."""
        last = self.last(struck, torque.shape[1])
        return self._condition(last, torque, jnp.zeros(torque.shape[1], bool))

    def _condition(
        self, last: LastFailure, torque: Float[Array, "3 m"], paused: Bool[Array, " m"]
    ) -> "ThrusterCondition":
        kind, amount = last.kind, last.amount
        silent = (kind == FailureKind.DEAD) | (kind == FailureKind.STUCK_AT) | paused
        partial = (kind == FailureKind.STUCK_AT) | (kind == FailureKind.LEAKING)
        return ThrusterCondition(
            jnp.where(silent, 0.0, jnp.where(kind == FailureKind.DEGRADED, amount, 1.0)),
            jnp.where(kind == FailureKind.STUCK_ON, 1.0, jnp.where(partial, amount, 0.0)),
            jnp.where(kind == FailureKind.DELAYED, amount, 0.0),
            self._turned(last, torque),
        )

    def two_signed(
        self, struck: Bool[Array, " f"], axes: Float[Array, "3 m"]
    ) -> tuple[Float[Array, " m"], Float[Array, " m"], Float[Array, "3 m"]]:
        """Return gain, level and axes of two-sided thrusters after the failures that have struck.

        Their torque over the limit is `gain` x commanded + `level`, along the axes. They may be
        dead, degraded, stuck, turned or reversed.
        """
        last = self.last(struck, axes.shape[1])
        return *last.two_signed(), self._turned(last, axes)

    def _turned(self, last: LastFailure, torque: Float[Array, "3 m"]) -> Float[Array, "3 m"]:
        for event in range(self.count):
            turns = (last.event == event) & (last.kind == FailureKind.TURNED)
            torque = jnp.where(turns[None], self.turned[event], torque)
        return torque


def _paused(last: LastFailure, t: RealScalar) -> Bool[Array, " m"]:
    """Whether each intermittent thruster pauses at a sample at time `t` (s)."""
    pauses = last.kind == FailureKind.INTERMITTENT
    since = t - jnp.where(pauses, last.since, t)
    within = since - CYCLE * jnp.floor(since / CYCLE)
    return pauses & (within < last.amount * CYCLE)


class ThrusterCondition(NamedTuple):
    """State of all thrusters: level = max(gain x commanded, floor), valves `delay` s late."""

    gain: Float[Array, " m"]
    floor: Float[Array, " m"]
    delay: Float[Array, " m"]
    torque: Float[Array, "3 m"]

    @staticmethod
    def sound(torque: Float[Array, "3 m"]) -> "ThrusterCondition":
        """Return the state of thrusters without failures."""
        one = jnp.ones(torque.shape[1])
        return ThrusterCondition(one, 0 * one, 0 * one, torque)
