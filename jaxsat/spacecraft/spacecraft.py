"""The rigid body, and the state of the plant: attitude, rate, and states of effectors."""

import dataclasses
from typing import TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, PyTree

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_array, as_float, concrete, numpy_if_known, require_inertia


def _as_inertia(value: ArrayLike | list | tuple) -> Matrix:
    array = as_float(value)
    if array.shape not in ((3,), (3, 3)):
        raise ValueError(
            "Argument `inertia` must be three principal moments or a 3x3 matrix in kg m², "
            f"but got shape {array.shape}."
        )
    if array.ndim == 2:
        return array
    moments = concrete(array)
    return jnp.diag(array) if moments is None else as_array(np.diag(moments))


def inverse_of(inertia: Matrix) -> Matrix:
    """Return the inverse of an inertia by cofactors: cheap inside a loop and free of LAPACK."""
    xp, (a, b, c) = numpy_if_known(inertia)
    cofactors = xp.stack([xp.cross(b, c), xp.cross(c, a), xp.cross(a, b)])
    inverse = cofactors.T / xp.dot(a, cofactors[0])
    return as_array(inverse) if isinstance(inverse, np.ndarray) else inverse


def adjugate(matrix: Matrix) -> Matrix:
    """Return the cofactors det(M) M⁻ᵀ, of a symmetric matrix its adjugate; M may be singular."""
    a, b, c = matrix
    return jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])


class Spacecraft(eqx.Module):
    """A rigid spacecraft with an inertia in body axes, kg m².

    `inertia` is given as three principal moments or as a symmetric positive-definite 3x3 matrix.
    Raises `ValueError` for anything else. The equations do not need J1 + J2 >= J3, which holds for
    every real body.
    """

    inertia: Matrix = eqx.field(converter=_as_inertia)

    def __check_init__(self):
        require_inertia("inertia", self.inertia)

    @property
    def moments(self) -> Vector:
        """Diagonal of the inertia, J1, J2, J3 of equation (37), kg m²."""
        inertia = concrete(self.inertia)
        if inertia is not None:
            return as_array(np.diagonal(inertia))
        a, b, c = self.inertia
        return jnp.stack([a[0], b[1], c[2]])  # far fewer operations than jnp.diagonal

    @property
    def momentum_unit(self) -> RealScalar:
        """Unit of momenta, N m s: the mean moment of inertia times 1 rad/s."""
        return jnp.mean(self.moments)

    @property
    def inverse_inertia(self) -> Matrix:
        """Inverse of the inertia, 1/(kg m²)."""
        return inverse_of(self.inertia)


OfEach = tuple[PyTree, ...]
"""One object for each effector of a body."""

State = TypeVar("State", bound=eqx.Module)


class PlantState(eqx.Module):
    """Attitude relative to the orbit frame, and inertial angular velocity in body axes, rad/s.

    `effectors` are the states of the body's effectors; None means all at rest.
    """

    attitude: AbstractAttitude
    omega: Vector = eqx.field(converter=as_float)
    effectors: OfEach | None = None

    @property
    def of_each(self) -> OfEach:
        """States of the effectors, possibly empty."""
        return self.effectors or ()

    def find(self, kind: type[State]) -> State | None:
        """Return the effector state of this class; None without one."""
        return next((one for one in self.of_each if isinstance(one, kind)), None)

    def normalised(self) -> "PlantState":
        """Return this state with attitude parameters that satisfy their constraint to round-off."""
        return dataclasses.replace(self, attitude=self.attitude.normalised())
