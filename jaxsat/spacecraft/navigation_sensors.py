"""Sensors of the navigation: a rate gyro at every sample, and a star tracker with latency."""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, UInt32

from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import (
    as_array,
    as_float,
    as_optional_float,
    not_negative,
    numpy_if_known,
    positive,
    require_counts,
    require_finite,
    require_positive,
)
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace
from jaxsat.spacecraft.environment.orbital_torques import Sunlight
from jaxsat.spacecraft.outages import outside_outages, require_outage
from jaxsat.spacecraft.sensor_failures import GyroFailures


class SensorContext(NamedTuple):
    """Inputs from a scenario for a sensor besides its own keys: the sample period (s) of its law,
    the Earth's magnetic field, sunlight, and the position along the orbit."""

    period: float
    field: AbstractMagneticField
    sunlight: Sunlight

    @property
    def place(self) -> AbstractPlace:
        """Position along the orbit, and orientation of the reference frame."""
        return self.sunlight.orbit


def as_three(value: ArrayLike | list | tuple) -> Vector:
    """Return a vector from one number for all axes, or one for each."""
    array = as_float(value)
    return as_float([value] * 3) if array.ndim == 0 else array


class Gyro(eqx.Module):
    """Three rate gyros along the body axes, sampled at the instants of a sampled law.

    The model is Farrenkopf's (J. Guidance and Control 1(4), 1978) in the discrete form of Crassidis
    and Junkins (Optimal Estimation of Dynamic Systems, 2nd ed., 2012, section 4.6). The measurement
    at a sample is (1 + s) (ω - m × ω) + b + n, saturated at ±`limit` (rad/s):

    - n is white with variance σv²/T + σu²T/12 on each axis, where T (s) is the time from sample to
      sample, σv is `noise_density` (angle random walk, rad/√s) and σu is `bias_walk` (rate random
      walk, rad/s^1.5);
    - the bias b (rad/s) moves by σu √T a sample, from `bias` plus a draw with the standard
      deviation `bias_sigma` on each axis;
    - s is `scale_factor`, the relative error on each axis, and m is `misalignment`, a small
      rotation (rad, body axes) of the three input axes.

    Measurements are invalid for `outage` (s) from `outage_start` (s) on, which must be later than
    the first sample, and again `outage_every` (s) later and so on; None for the first two is no
    outage, None for the last a single one. The gyros fail together, with the number 0 in
    `failures`, after the first sample.

    Raises `ValueError` for a negative density, walk or deviation, a limit that is not positive, and
    an outage without a start or a length.
    """

    noise_density: RealScalar = eqx.field(converter=not_negative("noise_density"), default=0.0)
    bias_walk: RealScalar = eqx.field(converter=not_negative("bias_walk"), default=0.0)
    bias: Vector = eqx.field(converter=as_three, default=0.0)
    bias_sigma: RealScalar = eqx.field(converter=not_negative("bias_sigma"), default=0.0)
    scale_factor: Vector = eqx.field(converter=as_three, default=0.0)
    misalignment: Vector = eqx.field(converter=as_three, default=0.0)
    limit: RealScalar = eqx.field(converter=positive("limit"), default=jnp.inf)
    outage_start: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    outage: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    outage_every: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    failures: GyroFailures | None = None

    def __check_init__(self):
        for name in ("bias", "scale_factor", "misalignment"):
            require_finite(name, getattr(self, name))
        require_outage(self.outage_start, self.outage, self.outage_every)
        if self.outage_start is not None:
            require_positive("outage_start", self.outage_start)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: SensorContext) -> "Gyro":
        """Return the gyro of a checked table `[gyro]` of a scenario; `context` is not used."""
        limit = values["limit_rad_s"]
        return cls(
            values["noise_density_rad_s_sqrt_Hz"],
            values["bias_walk_rad_s2_sqrt_Hz"],
            values["bias_rad_s"],
            values["bias_sigma_rad_s"],
            values["scale_factor"],
            values["misalignment_rad"],
            np.inf if limit is None else limit,
            values["outage_start_s"],
            values["outage_s"],
            values["outage_every_s"],
        )

    @property
    def repeats(self) -> bool:
        """Whether readings may be invalid or repeated."""
        return self.outage is not None or self.failures is not None

    def is_valid(self, sample: IntScalar, period: RealScalar) -> BoolScalar | None:
        """Whether the measurement of this sample is valid, None without outages and failures;
        samples are `period` s apart."""
        times = (self.outage_start, self.outage, self.outage_every)
        outside = outside_outages(sample, period, *times)
        if self.failures is None:
            return outside
        works = ~self.failures.dead(sample, period, 1)[0]
        return works if outside is None else outside & works

    def read(
        self,
        sample: IntScalar,
        period: RealScalar,
        rate: Vector,
        last: Vector,
        key: UInt32[Array, "2"],
    ) -> Vector:
        """Return what is read in place of the measured `rate` (rad/s) after the reading `last`.

        That is `last` while the rate is invalid. Spikes are a function of the `key`.
        """
        if self.failures is not None:
            (condition,) = self.failures.conditions(sample, period, key, 1)
            rate = jnp.where(condition.stuck, last, self._saturated(rate + condition.error))
        valid = self.is_valid(sample, period)
        return rate if valid is None else jnp.where(valid, rate, last)

    def rate_variance(self, period: RealScalar) -> RealScalar:
        """Return the white-noise variance of one sample, (rad/s)², for samples `period` s apart."""
        _, noise, walk, period = numpy_if_known(self.noise_density, self.bias_walk, period)
        return as_float(noise**2 / period + walk**2 * period / 12)

    def first_bias(self, noise: Vector) -> Vector:
        """Return the initial bias, rad/s, from standard normal numbers."""
        return self.bias + self.bias_sigma * noise

    def next_bias(self, bias: Vector, noise: Vector, period: RealScalar) -> Vector:
        """Return the bias one sample later, rad/s."""
        return bias + self.bias_walk * jnp.sqrt(period) * noise

    def measured(self, omega: Vector, bias: Vector, noise: Vector, period: RealScalar) -> Vector:
        """Return the measured rate, rad/s, for the true ω, a bias and standard normal numbers."""
        turned = omega - jnp.cross(self.misalignment, omega)
        white = jnp.sqrt(self.rate_variance(period)) * noise
        rate = (1 + self.scale_factor) * turned + bias + white
        return self._saturated(rate)

    def _saturated(self, rate: Vector) -> Vector:
        return jnp.minimum(jnp.maximum(rate, -self.limit), self.limit)


Queue = TypeVar("Queue")


class StarTracker(eqx.Module):
    """A star tracker whose samples coincide with samples of a sampled law.

    It measures at every `every`-th sample of the law, from the first on, and its measurement
    arrives `latency` samples later, or `arrival` (at most `latency`) samples later if that is not
    None. It is blind while |ω| exceeds `rate_limit` (rad/s), and for `outage` (s) from
    `outage_start` (s) on, and again `outage_every` (s) later and so on; None for the first two is
    no outage, None for the last a single one.

    The error is a small rotation with the standard deviations `across` (rad) about the two
    directions across the boresight and `along` (rad) about the boresight itself. The rows of
    `axes` are these three directions in body axes.

    Raises `ValueError` for a deviation or a limit that is not positive, for a boresight without a
    direction, and for counts that are not positive integers.
    """

    across: RealScalar
    along: RealScalar
    axes: Matrix
    rate_limit: RealScalar
    every: IntScalar
    latency: int = eqx.field(static=True)
    arrival: IntScalar | None
    outage_start: RealScalar | None
    outage: RealScalar | None
    outage_every: RealScalar | None

    def __init__(
        self,
        across: ArrayLike,
        along: ArrayLike,
        boresight: ArrayLike | list | tuple = (0.0, 0.0, 1.0),
        every: int = 1,
        latency: int = 0,
        rate_limit: ArrayLike = np.inf,
        outage_start: ArrayLike | None = None,
        outage: ArrayLike | None = None,
        outage_every: ArrayLike | None = None,
    ):
        self.across, self.along = as_float(across), as_float(along)
        self.axes = as_array(_frame(np.asarray(boresight, float)))
        self.rate_limit = as_float(rate_limit)
        self.every, self.latency, self.arrival = as_array(np.asarray(every)), latency, None
        self.outage_start, self.outage = as_optional_float(outage_start), as_optional_float(outage)
        self.outage_every = as_optional_float(outage_every)
        require_outage(self.outage_start, self.outage, self.outage_every)
        for name in ("across", "along", "rate_limit"):
            require_positive(name, getattr(self, name))
        require_counts(every=every)
        if latency < 0:
            raise ArgumentError("latency", "must be zero or positive", latency)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: SensorContext) -> "StarTracker":
        """Return the tracker of a checked table `[star_tracker]`."""
        period, update, limit = (
            context.period,
            values["update_period_s"],
            values["rate_limit_rad_s"],
        )
        return cls(
            values["across_rad"],
            values["along_rad"],
            values["boresight"],
            1 if update is None else round(update / period),
            round(values["latency_s"] / period),
            np.inf if limit is None else limit,
            values["outage_start_s"],
            values["outage_s"],
            values["outage_every_s"],
        )

    @property
    def deviations(self) -> Vector:
        """Standard deviations (rad) about the three `axes`."""
        return jnp.stack([self.across, self.across, self.along])

    def is_due(self, sample: IntScalar, period: RealScalar) -> BoolScalar:
        """Whether there is a measurement at this sample unless the tracker is blind."""
        due = sample % self.every == 0
        works = outside_outages(sample, period, self.outage_start, self.outage, self.outage_every)
        return due if works is None else due & works

    def measures(self, sample: IntScalar, period: RealScalar, omega: Vector) -> BoolScalar:
        """Whether the tracker measures at this sample; samples are `period` s apart."""
        return self.is_due(sample, period) & (jnp.sum(omega**2) <= self.rate_limit**2)

    def arriving(self, queue: Queue) -> Queue:
        """Return the measurement that arrives now from a queue of the last `latency` + 1."""
        place = 0 if self.arrival is None else self.latency - self.arrival
        return jax.tree.map(lambda part: part[place], queue)

    def measured(self, attitude: Quaternion, noise: Vector) -> Quaternion:
        """Return the measured attitude for the true one and standard normal numbers."""
        return attitude.turned((self.deviations * noise) @ self.axes)


def _frame(boresight: np.ndarray) -> np.ndarray:
    """Return two directions across a boresight and the boresight, as rows."""
    length = np.linalg.norm(boresight)
    if boresight.shape != (3,) or not 0 < length < np.inf:
        rule = "must be a direction in body axes, three numbers"
        raise ArgumentError("boresight", rule, boresight.tolist())
    along = boresight / length
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(along, first), along])
