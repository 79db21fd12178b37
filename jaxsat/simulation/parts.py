"""Finding parts of a loop by their kind."""

from typing import TypeVar

import jax
from jaxtyping import PyTree

from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft import AbstractFailures

Part = TypeVar("Part")


def parts_of(kind: type[Part], tree: PyTree) -> list[Part]:
    """All parts of one kind in a module."""
    parts = jax.tree.leaves(tree, is_leaf=lambda part: isinstance(part, kind))
    return [part for part in parts if isinstance(part, kind)]


def failures_of(loop: AbstractLoop) -> list[AbstractFailures]:
    """The failures in flight of a loop, effector by effector."""
    return parts_of(AbstractFailures, loop.plant.effectors)
