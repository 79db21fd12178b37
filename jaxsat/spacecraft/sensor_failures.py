"""Failures of sensors of the attitude in flight, and what such sensors then read."""

from collections.abc import Sequence
from statistics import NormalDist
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, UInt32

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.sensor import SensorFailureKind
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.failures import AbstractFailures


class SensorCondition(NamedTuple):
    """State of one sensor at a sample: whether it is `dead`, whether it is `stuck`, and the small
    rotation `turn` (rad, body axes) of its readings."""

    dead: BoolScalar
    stuck: BoolScalar
    turn: Vector


class SensorReading(NamedTuple):
    """A reading of a sensor, a quaternion or a vector, and whether there is one."""

    value: Float[Array, " n"]
    seen: BoolScalar


class SensorFailures(AbstractFailures):
    """Failures of the attitude sensors of a loop, which `number` counts from 0.

    A stuck sensor repeats its last reading: a star tracker its attitude relative to inertial axes,
    so that relative to the frame of the `orbit` it moves. The readings of a drifting one turn with
    the rate `drift` (f, 3) in rad/s, body axes, those of a spiking one by a drawn small rotation
    with the standard deviation `amount` (rad) about each axis where a standard normal number
    exceeds `quantile` (f,). A small rotation r has the angle 2 arctan(|r|/2).
    """

    part: ClassVar[str] = "sensor"
    kinds: ClassVar[type[AbstractFailureKind]] = SensorFailureKind

    drift: Float[Array, "f 3"] = eqx.field(converter=as_float)
    quantile: Float[Array, " f"] = eqx.field(converter=as_float)
    orbit: AbstractOrbit

    @classmethod
    def from_tables(
        cls, failures: Sequence[tuple[int, Any]], orbit: AbstractOrbit
    ) -> "SensorFailures | None":
        """Return the failures of checked tables, each with its sensor's number; None without."""
        if not failures:
            return None
        drift = [table.drift_rad_s or (0.0, 0.0, 0.0) for _, table in failures]
        quantile = [_upper_quantile(table.spike_probability or 0.0) for _, table in failures]
        return cls(*cls.columns_of(failures), drift, quantile, orbit)

    def conditions(
        self, sample: IntScalar, period: RealScalar, key: UInt32[Array, "2"], count: int
    ) -> tuple[SensorCondition, ...]:
        """Return the state of each of `count` sensors at a sample; samples are `period` s apart.

        Spikes are a function of the `key` of all sensors, and of the sample.
        """
        t = jnp.asarray(sample, period.dtype) * period
        last = self.last(t >= self.at, count)
        own = fold_in(key, jnp.asarray(name_number("spikes of sensors"), jnp.uint32))
        noise = sample_noise(own, sample, 4 * count, period.dtype).reshape(count, 4)
        return tuple(
            self._condition(t, last.kind[one], last.event[one], noise[one]) for one in range(count)
        )

    def _condition(
        self, t: RealScalar, kind: RealScalar, event: RealScalar, noise: Float[Array, "4"]
    ) -> SensorCondition:
        mine = jnp.arange(self.count, dtype=event.dtype) == event
        drift, quantile, size, at = (
            jnp.sum(jnp.where(mine if one.ndim == 1 else mine[:, None], one, 0.0), axis=0)
            for one in (self.drift, self.quantile, self.amount, self.at)
        )
        drifted = jnp.where(kind == SensorFailureKind.DRIFTING, (t - at) * drift, 0.0)
        spikes = (kind == SensorFailureKind.SPIKING) & (noise[3] > quantile)
        turn = drifted + jnp.where(spikes, size * noise[:3], 0.0)
        return SensorCondition(
            kind == SensorFailureKind.DEAD, kind == SensorFailureKind.STUCK, turn
        )

    def attitude(
        self,
        condition: SensorCondition,
        new: SensorReading,
        last: SensorReading,
        due: BoolScalar,
        period: RealScalar,
    ) -> tuple[SensorReading, SensorReading]:
        """Return what a star tracker reads, and its last reading after that.

        `new` would be read without a failure, and `last` was read before: attitudes relative to the
        orbit frame, one sample of `period` s ago. `due` is whether a stuck sensor repeats it now.
        """
        before = Quaternion(last.value)
        still = before.turned(-period * self.orbit.frame_rate(before)).q
        turned = Quaternion(new.value).turned(condition.turn).q
        return _read(condition, new.seen, turned, SensorReading(still, last.seen), due)

    def vector(
        self,
        condition: SensorCondition,
        new: SensorReading,
        last: SensorReading,
        due: BoolScalar,
    ) -> tuple[SensorReading, SensorReading]:
        """Return what a sensor of a vector reads, and its last reading after that.

        The arguments are those of `attitude`.
        """
        untouched = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0], new.value.dtype))
        turned = untouched.turned(condition.turn).as_dcm().matrix @ new.value
        return _read(condition, new.seen, turned, last, due)


def _read(
    condition: SensorCondition,
    seen: BoolScalar,
    turned: Float[Array, " n"],
    last: SensorReading,
    due: Bool[Array, ""],
) -> tuple[SensorReading, SensorReading]:
    works = seen & ~condition.dead & ~condition.stuck
    value = jnp.where(works, turned, last.value)
    repeats = condition.stuck & due & last.seen
    return SensorReading(value, works | repeats), SensorReading(value, works | last.seen)


def _upper_quantile(probability: float) -> float:
    """Return the number that a standard normal number exceeds with a probability."""
    if 0 < probability < 1:
        return -NormalDist().inv_cdf(probability)
    return -jnp.inf if probability else jnp.inf
