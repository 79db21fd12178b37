"""Finding parts of a loop by their kind."""

from typing import TypeVar

import jax
from jaxtyping import PyTree

from jaxsat.simulation.loops import AbstractLoop
from jaxsat.vehicle import FailureEvents, MagnetorquerFailures, WheelFailures

Part = TypeVar("Part")

AnyFailures = FailureEvents | WheelFailures | MagnetorquerFailures


def parts_of(kind: type[Part], tree: PyTree) -> list[Part]:
    """All parts of one kind in a module."""
    parts = jax.tree.leaves(tree, is_leaf=lambda part: isinstance(part, kind))
    return [part for part in parts if isinstance(part, kind)]


def failures_of(loop: AbstractLoop) -> list[AnyFailures]:
    """The failures in flight of a loop: of its thrusters, of its wheels, of its magnetorquers."""
    return [
        *parts_of(FailureEvents, getattr(loop, "actuators", None)),
        *parts_of(WheelFailures, loop.plant.wheels),
        *parts_of(MagnetorquerFailures, loop.plant.magnetorquers),
    ]
