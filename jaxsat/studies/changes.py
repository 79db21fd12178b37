"""A loop that is dispersed, what a quantity does to it, and which inertias a body can have."""

from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.normal_form import NormalForm
from jaxsat.control.ripple import RippleFilter
from jaxsat.control.three_axis import InternalModel
from jaxsat.core.array_types import BoolScalar, Matrix
from jaxsat.core.ranges import Range
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dispersible import Limits
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.spacecraft import Spacecraft


class PerturbedLoop(NamedTuple):
    """A closed loop and its start, as far as they have been dispersed, and the nominal loop."""

    loop: AbstractLoop
    start: PlantState
    nominal: AbstractLoop


Values = Float[Array, " size"]

Obstacle = Callable[[AbstractLoop], str | None]
"""Tells, as a clause, why a loop lacks a quantity, or None."""


def fixed(size: int) -> Callable[[AbstractLoop], int]:
    """The size of a quantity that takes so many numbers of any loop."""
    return lambda loop: size


class Quantity(NamedTuple):
    """What a quantity of `jaxsat.core.declaration.quantities` takes and does.

    `apply` puts the numbers into the model. `limits` are the least and the largest number that may
    be drawn for it, given the nominal loop, so that what comes of it stays in its range
    (`jaxsat.core.ranges`). `size` is how many numbers it takes. `obstacle` tells, as a clause, why
    a loop has no such quantity, or None.
    """

    apply: Callable[[PerturbedLoop, Values], PerturbedLoop]
    limits: Callable[[AbstractLoop], Limits]
    size: Callable[[AbstractLoop], int] = fixed(1)
    obstacle: Obstacle = lambda loop: None


def between(values: Range) -> Callable[[AbstractLoop], Limits]:
    """Limits of numbers that are drawn as they are."""
    return lambda loop: Limits.between(values)


def changing(
    values: Range, nominal: Callable[[AbstractLoop], Float[Array, " n"]]
) -> Callable[[AbstractLoop], Limits]:
    """Limits of relative changes of what `nominal` finds in a loop."""
    return lambda loop: Limits.of_change(values, nominal(loop))


def needs_torque_level(loop: AbstractLoop) -> str | None:
    """The obstacle unless torques reach the plant through actuators."""
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


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


LEAST_TORQUE = 1e-30
"""N m: tells frequencies apart where no torque does."""


def possible_inertia(inertia: Matrix) -> BoolScalar:
    """Whether a body of positive mass density can have this inertia: ½ tr(J) I - J > 0.

    The triangle inequality of the principal moments in the form that products of inertia leave
    simple; it implies J > 0.
    """
    return _positive(jnp.trace(inertia) / 2 * jnp.eye(3, dtype=inertia.dtype) - inertia)


def possible_body(loop: AbstractLoop) -> BoolScalar:
    """Whether a body can have the plant's inertia, and the rotors of its wheels are part of it."""
    return _with_rotors(loop.plant.spacecraft.inertia, loop)


def possible_belief(loop: AbstractLoop) -> BoolScalar:
    """Whether a body can have the inertia that the controller believes, with rotors added."""
    parts = parts_of(Spacecraft, controller_of(loop))
    return _with_rotors(parts[0].inertia + rotors_of(loop), loop)


def _with_rotors(inertia: Matrix, loop: AbstractLoop) -> BoolScalar:
    possible, stores = possible_inertia(inertia), [one.storage() for one in loop.plant.effectors]
    rotors = [one.rotors for one in stores if one is not None]
    if any(one.free_inertia() is not None for one in loop.plant.effectors):
        possible = possible & _positive(inertia - rotors_of(loop))
    return possible & jnp.all(jnp.concatenate(rotors) >= 0) if rotors else possible


def _positive(matrix: Matrix) -> BoolScalar:
    """Whether a symmetric matrix is positive definite, by its leading minors."""
    two = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    three = jnp.dot(matrix[0], jnp.cross(matrix[1], matrix[2]))
    return (matrix[0, 0] > 0) & (two > 0) & (three > 0)


def rotors_of(loop: AbstractLoop) -> Matrix:
    """What of the inertia moves freely in the plant's effectors, Σ J_w a aᵀ of wheels
    and Σ d dᵀ of flexible modes, kg m²."""
    free = (one.free_inertia() for one in loop.plant.effectors)
    return -sum((one for one in free if one is not None), jnp.zeros((3, 3)))


def periodic_of(loop: AbstractLoop) -> PeriodicTorque:
    """The plant's one periodic torque."""
    (torque,) = parts_of(PeriodicTorque, loop.plant.disturbance)
    return torque


def follow_frequency(loop: AbstractLoop) -> AbstractLoop:
    """The loop whose law knows the frequencies of the plant's periodic torque.

    That is its internal model about the first two axes and its ripple estimator about the axis
    without a torque, for the frequency that makes the most ripple about it.
    """
    torque = periodic_of(loop)
    forms = parts_of(NormalForm, controller_of(loop))
    normal = jnp.abs(forms[0].axes[2]) if forms else jnp.array([0.0, 0.0, 1.0])
    ripple = normal * (jnp.abs(torque.amplitude) + LEAST_TORQUE) / jnp.abs(torque.frequency)
    frequency = torque.frequency[jnp.argmax(ripple)]

    def change(part):
        if isinstance(part, InternalModel):
            return InternalModel(torque.frequency[:2])
        if isinstance(part, RippleFilter):
            return eqx.tree_at(lambda estimator: estimator.frequency, part, frequency)
        return part

    kinds = (InternalModel, RippleFilter)
    return with_controller(loop, map_parts(change, kinds, controller_of(loop)))
