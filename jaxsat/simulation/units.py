"""A loop's state scaled so that one tolerance suits small and large bodies.

Momenta of effectors scale with the body; no other part of a state has a unit of mass. Time is not
scaled. The relative tolerance limits the error of fast rates. Errors of slow rates, far below the
absolute tolerance, are limited through their effect on the attitude in the same step: trajectories
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
    """Inverse of `in_units`."""
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
