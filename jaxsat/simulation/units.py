"""A loop's state in units in which a number means the same of a small body and of a large one.

Momenta of effectors are as large as the body; all else in a state of jaxsat has no unit of mass.
Nothing needs a unit of time. The relative tolerance judges fast rates. The error of slow ones, far
below the absolute tolerance, is judged as what it adds to the attitude in the same step: flights
whose times differ by factors of 1e-6 and 1e6 agree to 1e-11 in this module's tests.
"""

import dataclasses
from collections.abc import Callable

import jax
from jaxtyping import Array, PyTree

from jaxsat.spacecraft.dynamics import PlantState, RigidBody


def in_units(body: RigidBody, state: PyTree) -> PyTree:
    """A state of a loop of this body, its rate or its error, with momenta in `momentum_unit`s.

    A momentum becomes a rate, in rad/s, so that one absolute tolerance suits rates and momenta.
    """
    unit = body.spacecraft.momentum_unit
    return _with_momenta(body, state, lambda momentum: momentum / unit)


def out_of_units(body: RigidBody, state: PyTree) -> PyTree:
    """The state that `in_units` takes to this one."""
    unit = body.spacecraft.momentum_unit
    return _with_momenta(body, state, lambda momentum: momentum * unit)


def _with_momenta(body: RigidBody, state: PyTree, change: Callable[[Array], Array]) -> PyTree:
    def of_plant(part: PyTree) -> PyTree:
        if not isinstance(part, PlantState) or not part.effectors:
            return part
        parts = zip(body.effectors, part.effectors, strict=True)
        states = tuple(one.with_momenta(own, change) for one, own in parts)
        return dataclasses.replace(part, effectors=states)

    return jax.tree.map(of_plant, state, is_leaf=lambda part: isinstance(part, PlantState))
