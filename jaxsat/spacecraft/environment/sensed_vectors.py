"""Vectors that sensors measure: known along the orbit, in the reference frame of the attitude."""

import abc
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace


class AbstractSensedVector(eqx.Module):
    """A vector that a sensor of the attitude measures, in the reference frame of the attitude.

    A vector that a scenario can name also has a `declaration`, a `VectorDeclaration`, and a class
    method `from_table(values, context)`: `values` has every declared key, `context` is a
    `SensorContext`. The `VectorSensor` that measures it has noise, errors, field of view, times,
    outages and failures. Arrays that it stores may change without recompilation.
    """

    @abc.abstractmethod
    def __call__(self, t: RealScalar) -> tuple[Vector, RealScalar]:
        """Return the vector at `t` (s), in the unit of the sensor, and its visibility, 1 or 0."""

    def distorted(self, t: RealScalar, vector: Vector) -> Vector:
        """Return what an ideal sensor sees in place of the true `vector`, both in body axes.

        A filter does not know the difference; by default there is none.
        """
        return vector


class FieldAlongOrbit(AbstractSensedVector):
    """The Earth's magnetic `field`, which a magnetometer measures."""

    field: AbstractMagneticField

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: Any) -> "FieldAlongOrbit":
        """Return the field of a scenario's `SensorContext`."""
        return cls(context.field)

    def __call__(self, t: RealScalar) -> tuple[Vector, RealScalar]:
        """Return B in the reference frame at `t` (s), T, and its visibility, always 1."""
        field = self.field(t)
        return field, jnp.ones_like(field[0])


class Nadir(AbstractSensedVector):
    """The direction to the Earth's centre from an `orbit`, which a horizon sensor measures."""

    orbit: AbstractPlace

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: Any) -> "Nadir":
        """Return the direction along the orbit of a scenario's `SensorContext`."""
        return cls(context.place)

    def __call__(self, t: RealScalar) -> tuple[Vector, RealScalar]:
        """Return the unit vector in the reference frame at `t` (s), and visibility, always 1."""
        up = self.orbit.up(t)
        return -up, jnp.ones_like(up[0])
