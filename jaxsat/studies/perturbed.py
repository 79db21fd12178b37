"""A closed loop and its start while numbers are dispersed."""

from typing import NamedTuple, TypeVar, cast

import equinox as eqx
import jax
from jaxtyping import Array, Float

from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector


class PerturbedLoop(NamedTuple):
    """A closed loop and its start, as far as they have been dispersed, and the nominal loop."""

    loop: AbstractLoop
    start: PlantState
    nominal: AbstractLoop


Values = Float[Array, " size"]

Kind = TypeVar("Kind", bound=AbstractEffector)


def effector_of(loop: AbstractLoop, kind: type[Kind]) -> Kind:
    """The plant's effector of this class, which `obstacle` has made sure of."""
    return cast(Kind, loop.plant.find(kind))


def controller_of(loop: AbstractLoop):
    """The controller of any loop."""
    if isinstance(loop, ErrorCoordinateLoop):
        return loop.law
    return cast(ContinuousLoop | SampledLoop, loop).controller


def with_controller(loop: AbstractLoop, controller) -> AbstractLoop:
    """The loop with another controller."""
    return eqx.tree_at(controller_of, loop, controller)


def in_loop(perturbed: PerturbedLoop, where, new) -> PerturbedLoop:
    """The perturbed loop with `new` in the place that `where` finds in it."""
    loop = eqx.tree_at(where, perturbed.loop, new, is_leaf=lambda part: part is None)
    return perturbed._replace(loop=loop)


def map_parts(change, kind: type | tuple[type, ...], tree):
    """The tree with every part of a kind changed."""
    return jax.tree.map(change, tree, is_leaf=lambda part: isinstance(part, kind))
