"""The rigid body, and the state of the plant: attitude, rate, and the states of effectors."""

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
    """Inverse of an inertia by cofactors: cheap inside a loop and free of LAPACK."""
    xp, (a, b, c) = numpy_if_known(inertia)
    cofactors = xp.stack([xp.cross(b, c), xp.cross(c, a), xp.cross(a, b)])
    inverse = cofactors.T / xp.dot(a, cofactors[0])
    return as_array(inverse) if isinstance(inverse, np.ndarray) else inverse


class Spacecraft(eqx.Module):
    """A rigid spacecraft with an inertia in body axes, kg m².

    `inertia` is given as three principal moments or as a symmetric positive-definite 3x3 matrix.
    Raises `ValueError` for anything else. Positive definite is enough for the equations; that the
    moments also obey the triangle inequality J1 + J2 >= J3, as those of every real body do, is
    told by `obeys_triangle_inequality`.
    """

    inertia: Matrix = eqx.field(converter=_as_inertia)

    def __check_init__(self):
        require_inertia("inertia", self.inertia)

    @property
    def moments(self) -> Vector:
        """The diagonal of the inertia, J1, J2, J3 of equation (37), kg m²."""
        inertia = concrete(self.inertia)
        if inertia is not None:
            return as_array(np.diagonal(inertia))
        a, b, c = self.inertia
        return jnp.stack([a[0], b[1], c[2]])  # far fewer operations than jnp.diagonal

    @property
    def momentum_unit(self) -> RealScalar:
        """The mean moment of inertia times 1 rad/s, N m s: what momenta are large or small by."""
        return jnp.mean(self.moments)

    @property
    def inverse_inertia(self) -> Matrix:
        """Inverse of the inertia."""
        return inverse_of(self.inertia)

    def obeys_triangle_inequality(self) -> bool:
        """Whether a body of positive mass density can have this inertia (a tolerance of 1e-9)."""
        low, middle, high = jnp.linalg.eigvalsh(self.inertia)
        return bool(low + middle >= high * (1 - 1e-9))


OfEach = tuple[PyTree, ...]
"""One thing for each effector of a body."""

State = TypeVar("State", bound=eqx.Module)


class PlantState(eqx.Module):
    """Attitude relative to the orbit frame, and inertial angular velocity in body axes, rad/s.

    `effectors` are the states of those of the body; None is all at rest.
    """

    attitude: AbstractAttitude
    omega: Vector = eqx.field(converter=as_float)
    effectors: OfEach | None = None

    @property
    def of_each(self) -> OfEach:
        """The states of effectors, of which there may be none."""
        return self.effectors or ()

    def find(self, kind: type[State]) -> State | None:
        """The state of an effector that is of this class; None without one."""
        return next((one for one in self.of_each if isinstance(one, kind)), None)

    def normalised(self) -> "PlantState":
        """This state with attitude parameters that obey their constraint to rounding."""
        return dataclasses.replace(self, attitude=self.attitude.normalised())
