"""Sensors of a vector known along the orbit, such as magnetometer and Sun sensor."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, UInt32

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import (
    as_array,
    as_float,
    as_optional_float,
    concrete,
    positive,
    require_counts,
    require_directions,
    require_finite,
)
from jaxsat.core.declaration.sensor import vector_keys
from jaxsat.core.errors import ArgumentError
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.core.trigonometry import cos
from jaxsat.spacecraft.environment.sensed_vectors import AbstractSensedVector
from jaxsat.spacecraft.navigation_sensors import as_three
from jaxsat.spacecraft.outages import outside_outages, require_outage


class Observation(NamedTuple):
    """A vector measured in body axes, and its value then in the reference frame.

    Both have the unit of the sensor. `seen` is false without a measurement.
    """

    measured: Float[Array, "*latency 3"]
    reference: Float[Array, "*latency 3"]
    seen: Bool[Array, "*latency"]


class VectorSensor(eqx.Module):
    """A sensor that measures in body axes a vector known in the reference frame of the attitude.

    `reference` is the vector along the orbit. The measurement of a vector that is v in body axes,
    `distorted` by the sensor if need be, is (1 + s) (v - m × v) + b + n: s is
    `scale_factor`, the relative error on each axis, m is `misalignment`, a small rotation (rad), b
    is `bias`, and n is white noise with the standard deviation `noise` on each axis. For a unit
    vector only the noise across it matters, which is an angle (Shuster and Oh, J. Guidance and
    Control 4(1), 1981).

    It measures at every `every`-th sample of a sampled law, from the first on, with a latency of
    `latency` samples. It is blind where a unit vector is more than `half_angle` (rad) from the
    `boresight`, None for an unlimited field of view, and for `outage` (s) from `outage_start` (s)
    on, None for both is no outage, and again `outage_every` (s) later and so on, None for a single
    outage. `name` selects its noise stream.

    Raises `ValueError` for noise that is not positive, numbers that are not finite, a boresight
    without a direction, counts that are not positive, and an outage without a start or a length.
    """

    reference: AbstractSensedVector
    name: str = eqx.field(static=True)
    noise: RealScalar = eqx.field(converter=positive("noise"))
    bias: Vector = eqx.field(converter=as_three, default=0.0)
    scale_factor: Vector = eqx.field(converter=as_three, default=0.0)
    misalignment: Vector = eqx.field(converter=as_three, default=0.0)
    boresight: Vector = eqx.field(converter=as_float, default=(0.0, 0.0, 1.0))
    half_angle: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    every: IntScalar = eqx.field(converter=lambda count: as_array(np.asarray(count)), default=1)
    latency: int = eqx.field(static=True, default=0)
    outage_start: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    outage: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    outage_every: RealScalar | None = eqx.field(converter=as_optional_float, default=None)

    def __check_init__(self):
        for name in ("bias", "scale_factor", "misalignment"):
            require_finite(name, getattr(self, name))
        require_directions("boresight", self.boresight[:, None])
        require_outage(self.outage_start, self.outage, self.outage_every)
        every = concrete(self.every)
        require_counts(every=None if every is None else int(every))
        if self.latency < 0:
            raise ArgumentError("latency", "must be zero or positive", self.latency)

    @property
    def key(self) -> str:
        """Name as that of a table."""
        return self.name.replace(" ", "_")

    @classmethod
    def from_table(
        cls,
        name: str,
        unit: str,
        reference: AbstractSensedVector,
        values: Mapping[str, Any],
        period: float,
    ) -> "VectorSensor":
        """Return the sensor of a vector in a `unit` from a checked table; `period` (s) is the
        law's."""
        numbers = {key.stem: values[key.name] for key in vector_keys(unit)}
        update, latency = numbers.pop("update_period"), numbers.pop("latency")
        every = 1 if update is None else round(update / period)
        words = name.replace("_", " ")
        return cls(reference, words, every=every, latency=round(latency / period), **numbers)

    def observed(
        self, sample: IntScalar, period: RealScalar, attitude: Quaternion, key: UInt32[Array, "2"]
    ) -> Observation:
        """Return the measurement at a sample of the run; samples are `period` s apart.

        The noise is a function of the `key` of all sensors, the sensor's name and the sample.
        """
        t = jnp.asarray(sample, period.dtype) * period
        reference, light = self.reference(t)
        vector = attitude.as_dcm().matrix @ reference
        own = fold_in(key, jnp.asarray(name_number(self.name), jnp.uint32))
        noise = self.noise * sample_noise(own, sample, 3, vector.dtype)
        ideal = self.reference.distorted(t, vector)
        turned = ideal - jnp.cross(self.misalignment, ideal)
        measured = (1 + self.scale_factor) * turned + self.bias + noise
        seen = self.is_due(sample, period) & (light > 0)
        if self.half_angle is not None:
            middle = self.boresight / jnp.sqrt(jnp.sum(self.boresight**2))
            seen = seen & (middle @ vector >= cos(self.half_angle))
        return Observation(measured, reference, seen)

    def is_due(self, sample: IntScalar, period: RealScalar) -> BoolScalar:
        """Whether there is a measurement at this sample of what is visible."""
        due = sample % self.every == 0
        works = outside_outages(sample, period, self.outage_start, self.outage, self.outage_every)
        return due if works is None else due & works
