"""Failures of sensors in flight, and what such sensors then read."""

from collections.abc import Sequence
from statistics import NormalDist
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt32

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.sensor import (
    GyroFailureKind,
    SensorFailureKind,
    TachometerFailureKind,
)
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.core.ranges import FROM_ZERO, SECONDS, Range
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.failures import AbstractFailures, LastFailure


class SensorCondition(NamedTuple):
    """State of one sensor at a sample: whether it is `dead`, whether it is `stuck`, and the `error`
    of its readings: a small rotation (rad, body axes), rates (rad/s) or a momentum (N m s)."""

    dead: BoolScalar
    stuck: BoolScalar
    error: Float[Array, " n"]


class SensorReading(NamedTuple):
    """A reading of a sensor, a quaternion or a vector, and whether there is one."""

    value: Float[Array, " n"]
    seen: BoolScalar


class AbstractSensorFailures(AbstractFailures):
    """Failures of sensors of one sort, which `number` counts from 0.

    A stuck sensor repeats its last reading. The error of a drifting one grows at the rate `drift`
    (f, n) per second, that of a spiking one is drawn with the standard deviation `amount` of each
    component where a standard normal number exceeds `quantile` (f,).
    """

    part: ClassVar[str] = "sensor"
    kinds: ClassVar[Any]
    spikes: ClassVar[str]
    """Name of the random numbers of spikes."""
    times: ClassVar[Range] = FROM_ZERO
    """When one may fail, s."""

    drift: Float[Array, "f n"] = eqx.field(converter=as_float)
    quantile: Float[Array, " f"] = eqx.field(converter=as_float)

    @classmethod
    def from_tables(cls, failures: Sequence[tuple[int, Any]], *others: Any) -> Any:
        """Return the failures of checked tables, each with its sensor's number; None without."""
        if not failures:
            return None
        (drift,) = cls.kinds.DRIFTING.amounts
        size = drift.kind.size or 1
        drifts = [np.broadcast_to(getattr(table, drift.name) or 0.0, size) for _, table in failures]
        quantile = [_upper_quantile(table.spike_probability or 0.0) for _, table in failures]
        return cls(*cls.columns_of(failures), drifts, quantile, *others)

    def dead(self, sample: IntScalar, period: RealScalar, count: int) -> Bool[Array, " m"]:
        """Whether each of `count` sensors is dead at a sample; samples are `period` s apart."""
        return self._struck(sample, period, count)[1].kind == self.kinds.DEAD

    def conditions(
        self, sample: IntScalar, period: RealScalar, key: UInt32[Array, "2"], count: int
    ) -> tuple[SensorCondition, ...]:
        """Return the state of each of `count` sensors at a sample; samples are `period` s apart.

        Spikes are a function of the `key` of all sensors, and of the sample.
        """
        t, last = self._struck(sample, period, count)
        own, size = fold_in(key, jnp.asarray(name_number(self.spikes), jnp.uint32)), self._size
        noise = sample_noise(own, sample, (size + 1) * count, period.dtype)
        noise = noise.reshape(count, size + 1)
        return tuple(
            self._condition(t, last.kind[one], last.event[one], noise[one]) for one in range(count)
        )

    @property
    def _size(self) -> int:
        """Number of components of an error."""
        return self.drift.shape[-1]

    def _struck(
        self, sample: IntScalar, period: RealScalar, count: int
    ) -> tuple[RealScalar, LastFailure]:
        """The time (s) of a sample, and the last failure of each of `count` sensors."""
        t = jnp.asarray(sample, period.dtype) * period
        return t, self.last(t >= self.at, count)

    def _condition(
        self, t: RealScalar, kind: RealScalar, event: RealScalar, noise: Float[Array, " k"]
    ) -> SensorCondition:
        mine, kinds = jnp.arange(self.count, dtype=event.dtype) == event, self.kinds
        drift, quantile, size, at = (
            jnp.sum(jnp.where(mine if one.ndim == 1 else mine[:, None], one, 0.0), axis=0)
            for one in (self.drift, self.quantile, self.amount, self.at)
        )
        drifted = jnp.where(kind == kinds.DRIFTING, (t - at) * drift, 0.0)
        spikes = (kind == kinds.SPIKING) & (noise[-1] > quantile)
        error = drifted + jnp.where(spikes, size * noise[:-1], 0.0)
        return SensorCondition(kind == kinds.DEAD, kind == kinds.STUCK, error)


class GyroFailures(AbstractSensorFailures):
    """Failures of the three gyros of a loop, which fail together; errors are rates (rad/s)."""

    kinds: ClassVar[type[AbstractFailureKind]] = GyroFailureKind
    spikes: ClassVar[str] = "spikes of gyros"
    times: ClassVar[Range] = SECONDS  # after the first sample


class TachometerFailures(AbstractSensorFailures):
    """Failures of the tachometers of wheels, by the wheel; errors are momenta (N m s)."""

    kinds: ClassVar[type[AbstractFailureKind]] = TachometerFailureKind
    spikes: ClassVar[str] = "spikes of tachometers"
    times: ClassVar[Range] = SECONDS


class SensorFailures(AbstractSensorFailures):
    """Failures of the attitude sensors of a loop, whose errors turn their readings.

    A stuck star tracker repeats its attitude relative to inertial axes, so that relative to the
    frame of the `orbit` it moves. A small rotation r has the angle 2 arctan(|r|/2).
    """

    kinds: ClassVar[type[AbstractFailureKind]] = SensorFailureKind
    spikes: ClassVar[str] = "spikes of sensors"

    orbit: AbstractOrbit

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
        turned = Quaternion(new.value).turned(condition.error).q
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
        identity = Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0], new.value.dtype))
        turned = identity.turned(condition.error).as_dcm().matrix @ new.value
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
