"""A loop's state in units in which a number means the same of a small body and of a large one.

Momenta of wheels are as large as the body; all else in a state of jaxsat has no unit of mass.
"""

import dataclasses
from collections.abc import Callable

import jax
from jaxtyping import Array, Float, PyTree

from jaxsat.spacecraft.dynamics import PlantState, RigidBody


def in_units(body: RigidBody, state: PyTree) -> PyTree:
    """A state of a loop of this body, its rate or its error, with momenta in `momentum_unit`s.

    A momentum becomes a rate, in rad/s, so that one absolute tolerance suits rates and momenta.
    """
    return _changed(body, state, lambda momentum, unit: momentum / unit)


def out_of_units(body: RigidBody, state: PyTree) -> PyTree:
    """The state that `in_units` takes to this one."""
    return _changed(body, state, lambda momentum, unit: momentum * unit)


def _changed(
    body: RigidBody,
    state: PyTree,
    change: Callable[[Float[Array, "..."], Float[Array, ""]], Float[Array, "..."]],
) -> PyTree:
    unit = body.spacecraft.momentum_unit

    def of_plant(part: PyTree) -> PyTree:
        if not isinstance(part, PlantState):
            return part
        momenta = jax.tree.map(lambda momentum: change(momentum, unit), part.effectors)
        return dataclasses.replace(part, effectors=momenta)

    return jax.tree.map(of_plant, state, is_leaf=lambda part: isinstance(part, PlantState))
