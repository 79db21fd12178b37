"""Disturbance torques on the body, in body axes, N m."""

import abc
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import finite
from jaxsat.core.declaration import PartDeclaration
from jaxsat.core.declaration.disturbances import CONSTANT, GRAVITY_GRADIENT, PERIODIC
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.core.trigonometry import sin
from jaxsat.spacecraft.environment.orbit import AbstractMagneticField, AbstractPlace, CircularOrbit
from jaxsat.spacecraft.environment.sensed_vectors import AbstractSensedVector


class DisturbanceContext(NamedTuple):
    """Inputs from a scenario for a disturbance besides its own keys.

    The nominal `inertia` (kg m²), the `orbit_rate` (rad/s) of the reference frame, the magnetic
    `field` along the orbit, checked tables `[[panel]]`, and `sunlight`, which is the direction to
    the Sun with its shadow, in the reference frame of the attitude; a scenario always gives it.
    """

    inertia: Float[np.ndarray, "3 3"]
    orbit_rate: float
    field: AbstractMagneticField
    panels: tuple[Any, ...] = ()
    sunlight: AbstractSensedVector | None = None

    @property
    def place(self) -> AbstractPlace:
        """The orbit."""
        return self.field.orbit

    @property
    def circle(self) -> CircularOrbit:
        """The circular orbit; raises `ValueError` for an elliptic one."""
        return self.field.circle


class AbstractDisturbance(eqx.Module):
    """A disturbance torque T_d in body axes.

    A disturbance that a scenario can name also has a `declaration`, a `PartDeclaration`, and a
    class method `from_table(values, context)`: `values` has every declared key, for jaxsat's own
    disturbances every key of `[disturbance]`; `context` is a `DisturbanceContext`. Arrays that it
    stores may change without recompilation.
    """

    @abc.abstractmethod
    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return the torque at time `t` (s), N m; `inertia` is the body's true inertia, kg m²."""


class NoDisturbance(AbstractDisturbance):
    """Absence of disturbance torques."""

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return zero."""
        return jnp.zeros(3, inertia.dtype)


class PeriodicTorque(AbstractDisturbance):
    """Equation (2): d_i = amplitude_i sin(frequency_i t + phase_i).

    `amplitude` in N m, `frequency` in rad/s, `phase` in rad, each of shape (3,). The paper has no
    phase and prints Ω3 where it means Ω2 in d2.
    """

    declaration: ClassVar[PartDeclaration] = PERIODIC

    amplitude: Vector = eqx.field(converter=finite("amplitude"))
    frequency: Vector = eqx.field(converter=finite("frequency"))
    phase: Vector = eqx.field(converter=finite("phase"), default=(0.0, 0.0, 0.0))

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: DisturbanceContext) -> "PeriodicTorque":
        """Return the torque of a table of a scenario, with zeros for absent keys."""
        return cls(values["amplitude_N_m"], values["frequency_rad_s"], values["phase_rad"])

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return the torque of equation (2) at time `t` (s), N m."""
        return self.at(t)

    def at(self, t: RealScalar) -> Vector:
        """Return the torque of equation (2) at time `t` (s), N m."""
        return self.amplitude * sin(self.frequency * t + self.phase)


class ConstantTorque(AbstractDisturbance):
    """A torque fixed in body axes (shape (3,), N m), such as that of a leaking valve."""

    declaration: ClassVar[PartDeclaration] = CONSTANT

    torque: Vector = eqx.field(converter=finite("torque"))

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> "ConstantTorque | None":
        """Return the torque of a table of a scenario; None where it is zero."""
        return cls(values["constant_N_m"]) if any(values["constant_N_m"]) else None

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return the constant torque, N m."""
        return self.torque


class GravityGradient(AbstractDisturbance):
    """Gravity-gradient torque 3 ω0² n × J n, n the direction to the Earth's centre.

    `orbit_rate` is ω0 in rad/s. Hughes, Spacecraft Attitude Dynamics, 1986, section 8.1.
    """

    declaration: ClassVar[PartDeclaration] = GRAVITY_GRADIENT

    orbit_rate: RealScalar = eqx.field(converter=finite("orbit_rate"))

    @classmethod
    def from_table(
        cls, values: Mapping[str, Any], context: DisturbanceContext
    ) -> AbstractDisturbance | None:
        """Return the torque of a table of a scenario; None where it is disabled."""
        if not values["gravity_gradient"]:
            return None
        place = context.place
        return (
            cls(context.orbit_rate)
            if isinstance(place, CircularOrbit)
            else GravityGradientAt(place)
        )

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return 3 ω0² n × J n with n = C (0, 0, 1)ᵀ, N m."""
        nadir = attitude.as_dcm().matrix[:, 2]
        return 3 * self.orbit_rate**2 * jnp.cross(nadir, inertia @ nadir)


class GravityGradientAt(AbstractDisturbance):
    """Gravity-gradient torque 3 GM/r³ n × J n at the `place` of any orbit, n towards the centre."""

    place: AbstractPlace

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return 3 GM/r³ n × J n, N m."""
        nadir = -(attitude.as_dcm().matrix @ self.place.up(t))
        size = 3 * EARTH_GRAVITY / self.place.distance(t) ** 3
        return size * jnp.cross(nadir, inertia @ nadir)


def terms_of(disturbance: AbstractDisturbance) -> tuple[AbstractDisturbance, ...]:
    """Return the terms of a sum, or the disturbance alone."""
    return disturbance.terms if isinstance(disturbance, SumOfDisturbances) else (disturbance,)


def has_gravity_gradient(disturbance: AbstractDisturbance) -> bool:
    """Whether a disturbance includes the gravity gradient on a circular orbit."""
    return any(isinstance(term, GravityGradient) for term in terms_of(disturbance))


class SumOfDisturbances(AbstractDisturbance):
    """Sum of several disturbances."""

    terms: tuple[AbstractDisturbance, ...]

    def __call__(self, t: RealScalar, attitude: AbstractAttitude, inertia: Matrix) -> Vector:
        """Return the sum of the terms, N m."""
        return sum((term(t, attitude, inertia) for term in self.terms), jnp.zeros(3, inertia.dtype))
