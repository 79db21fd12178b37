"""Perturbed loops, changes by dispersed quantities, and the physically possible inertias."""

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
    """A closed loop and its start, with the dispersions applied so far, and the nominal loop."""

    loop: AbstractLoop
    start: PlantState
    nominal: AbstractLoop


Values = Float[Array, " size"]

Obstacle = Callable[[AbstractLoop], str | None]
"""Reason, as a clause, why a loop lacks a quantity, or None."""


def fixed(size: int) -> Callable[[AbstractLoop], int]:
    """Constant size of a quantity, for any loop."""
    return lambda loop: size


class Quantity(NamedTuple):
    """Effect and size of a quantity of `jaxsat.core.declaration.quantities`.

    `apply` puts the numbers into the model. `limits` are the smallest and the largest number that
    may be drawn, given the nominal loop, so that the results stay in their range
    (`jaxsat.core.ranges`). `size` is the count of numbers. `obstacle` is the reason, as a clause,
    why a loop has no such quantity, or None.
    """

    apply: Callable[[PerturbedLoop, Values], PerturbedLoop]
    limits: Callable[[AbstractLoop], Limits]
    size: Callable[[AbstractLoop], int] = fixed(1)
    obstacle: Obstacle = lambda loop: None


def between(values: Range) -> Callable[[AbstractLoop], Limits]:
    """Limits of absolute values."""
    return lambda loop: Limits.between(values)


def changing(
    values: Range, nominal: Callable[[AbstractLoop], Float[Array, " n"]]
) -> Callable[[AbstractLoop], Limits]:
    """Limits of changes relative to the value of `nominal` in a loop."""
    return lambda loop: Limits.of_change(values, nominal(loop))


def needs_torque_level(loop: AbstractLoop) -> str | None:
    """Obstacle to a quantity unless torques reach the plant through actuators."""
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


def controller_of(loop: AbstractLoop):
    """Return the controller of any loop."""
    if isinstance(loop, ErrorCoordinateLoop):
        return loop.law
    return cast(ContinuousLoop | SampledLoop, loop).controller


def with_controller(loop: AbstractLoop, controller) -> AbstractLoop:
    """Return the loop with another controller."""
    return eqx.tree_at(controller_of, loop, controller)


def in_loop(perturbed: PerturbedLoop, where, new) -> PerturbedLoop:
    """Return the perturbed loop with `new` at the place that `where` selects."""
    loop = eqx.tree_at(where, perturbed.loop, new, is_leaf=lambda part: part is None)
    return perturbed._replace(loop=loop)


def map_parts(change, kind: type | tuple[type, ...], tree):
    """Return the tree with every part of a kind changed."""
    return jax.tree.map(change, tree, is_leaf=lambda part: isinstance(part, kind))


LEAST_TORQUE = 1e-30
"""Torque, N m, that orders frequencies if no torque amplitude does."""


def possible_inertia(inertia: Matrix) -> BoolScalar:
    """Whether a body of positive mass density can have this inertia: ½ tr(J) I - J > 0.

    The triangle inequality of the principal moments in a form without eigenvalues, also for
    products of inertia; it implies J > 0.
    """
    return _positive(jnp.trace(inertia) / 2 * jnp.eye(3, dtype=inertia.dtype) - inertia)


def possible_body(loop: AbstractLoop) -> BoolScalar:
    """Whether the plant's inertia is possible and contains the rotors of the wheels."""
    return _with_rotors(loop.plant.spacecraft.inertia, loop)


def possible_belief(loop: AbstractLoop) -> BoolScalar:
    """Whether the inertia of the controller's model, with rotors added, is possible."""
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
    """Inertia that moves freely in the plant's effectors, Σ J_w a aᵀ of wheels and Σ d dᵀ of
    flexible modes, kg m²."""
    free = (one.free_inertia() for one in loop.plant.effectors)
    return -sum((one for one in free if one is not None), jnp.zeros((3, 3)))


def periodic_of(loop: AbstractLoop) -> PeriodicTorque:
    """Return the plant's only periodic torque."""
    (torque,) = parts_of(PeriodicTorque, loop.plant.disturbance)
    return torque


def follow_frequency(loop: AbstractLoop) -> AbstractLoop:
    """Return the loop with the frequencies of the plant's periodic torque in its law.

    They are those of the internal model about the first two axes and of the ripple estimator about
    the undriven axis, for the frequency with the largest ripple about it.
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
