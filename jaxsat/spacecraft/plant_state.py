"""The state of the plant: attitude, angular velocity, and the states of effectors."""

import dataclasses
from typing import TypeVar

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import as_float

OfEach = tuple[PyTree, ...]
"""One thing for each effector of a body."""

State = TypeVar("State", bound=eqx.Module)


class PlantState(eqx.Module):
    """Attitude relative to the orbit frame, and inertial angular velocity in body axes, rad/s.

    `effectors` are the states of those of the body; None is all at rest.
    """

    attitude: AbstractAttitude
    omega: Float[Array, "3"] = eqx.field(converter=as_float)
    effectors: OfEach | None = None

    @property
    def of_each(self) -> OfEach:
        """The states of effectors, of which there may be none."""
        return self.effectors or ()

    def find(self, kind: type[State]) -> State | None:
        """The state of an effector that is of this class; None without one."""
        return next((one for one in self.of_each if isinstance(one, kind)), None)

    def normalised(self) -> "PlantState":
        """The same with attitude parameters that obey their constraint to rounding."""
        return dataclasses.replace(self, attitude=self.attitude.normalised())
