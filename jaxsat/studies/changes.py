"""A loop that is dispersed, and how numbers go into body, environment, law's model and start."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, TypeVar, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.controller import AbstractBacksteppingLaw
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.ripple import RippleFilter
from jaxsat.control.three_axis import InternalModel
from jaxsat.core.array_types import BoolScalar, Matrix
from jaxsat.core.attitude import DCM, WZ, AbstractAttitude, Quaternion
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.environment.disturbances import (
    ConstantTorque,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.sensors import turned_slightly
from jaxsat.spacecraft.spacecraft import Spacecraft


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


def scaled_inertia(inertia: Matrix, change: Values) -> Matrix:
    """J_ij √((1 + change_i)(1 + change_j)), NaN where a factor is negative."""
    root = jnp.sqrt(1 + change)
    return inertia * root[:, None] * root[None, :]


def set_inertia(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    """The case with moments and products scaled by relative changes of J1, J2, J3."""
    return in_loop(
        perturbed,
        lambda loop: loop.plant.spacecraft.inertia,
        scaled_inertia(perturbed.loop.plant.spacecraft.inertia, change),
    )


def set_products(perturbed: PerturbedLoop, share: Values) -> PerturbedLoop:
    """The case with products of inertia added, in parts of the least nominal moment."""
    smallest = jnp.min(perturbed.nominal.plant.spacecraft.moments)
    xy, xz, yz = share * smallest
    zero = jnp.zeros_like(xy)
    extra = jnp.stack(
        [jnp.stack([zero, xy, xz]), jnp.stack([xy, zero, yz]), jnp.stack([xz, yz, zero])]
    )
    return in_loop(
        perturbed,
        lambda loop: loop.plant.spacecraft.inertia,
        perturbed.loop.plant.spacecraft.inertia + extra,
    )


def follow_frequency(loop: AbstractLoop) -> AbstractLoop:
    """The loop whose law knows the frequencies of the plant's periodic torque.

    That is its internal model about the first two axes and its ripple estimator about the axis
    without a torque, for the frequency that makes the most ripple about it.
    """
    (torque,) = parts_of(PeriodicTorque, loop.plant.disturbance)
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


def set_constant_torque(perturbed: PerturbedLoop, torque: Values) -> PerturbedLoop:
    """The case with a constant torque (N m) beside the disturbances that there are."""
    disturbance = SumOfDisturbances((perturbed.loop.plant.disturbance, ConstantTorque(torque)))
    return in_loop(perturbed, lambda loop: loop.plant.disturbance, disturbance)


def set_model_inertia(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    """The case with a relative change of the inertia, wheels locked, that the law believes."""
    rotors = rotors_of(perturbed.nominal)

    def changed(part):
        if not isinstance(part, Spacecraft):
            return part
        return Spacecraft(scaled_inertia(part.inertia + rotors, change) - rotors)

    controller = map_parts(changed, Spacecraft, controller_of(perturbed.loop))
    return perturbed._replace(loop=with_controller(perturbed.loop, controller))


def set_model_orbit_rate(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    """The case with a relative change of the orbit rate that the controller believes."""

    def changed(part):
        is_orbit = isinstance(part, AbstractOrbit)
        return (
            eqx.tree_at(lambda o: o.rate, part, part.rate * (1 + change[0])) if is_orbit else part
        )

    controller = map_parts(changed, AbstractOrbit, controller_of(perturbed.loop))
    return perturbed._replace(loop=with_controller(perturbed.loop, controller))


def set_attitude(perturbed: PerturbedLoop, q: Values) -> PerturbedLoop:
    """The case with another initial attitude, a unit quaternion."""
    return _with_attitude(perturbed, Quaternion(q))


def set_tilt_by(change: Callable[[WZ, Values], WZ]):
    """Gives the function that changes the initial (w, z) parameters of a case."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        return _with_attitude(perturbed, change(perturbed.start.attitude.as_wz(), values))

    return apply


def resized(wz: WZ, size: Values) -> WZ:
    """The attitude with w in the same direction, of another length."""
    return WZ(wz.w * (size[0] / jnp.sqrt(jnp.sum(wz.w**2))), wz.z)


def redirected(wz: WZ, angle: Values) -> WZ:
    """The attitude with w of the same length, in another direction (rad)."""
    size = jnp.sqrt(jnp.sum(wz.w**2))
    return WZ(size * jnp.stack([jnp.cos(angle[0]), jnp.sin(angle[0])]), wz.z)


def set_attitude_error(perturbed: PerturbedLoop, rotation: Values) -> PerturbedLoop:
    """The case with its initial attitude turned by a rotation vector in body axes, rad."""
    half = jnp.sqrt(jnp.sum(rotation**2)) / 2
    stretch = jnp.where(half > 0, jnp.tan(half) / jnp.where(half > 0, half, 1.0), 1.0)
    return _with_attitude(perturbed, turned_slightly(perturbed.start.attitude, stretch * rotation))


def set_omega(perturbed: PerturbedLoop, omega: Values) -> PerturbedLoop:
    """The case with another initial angular velocity, rad/s."""
    return perturbed._replace(start=dataclasses.replace(perturbed.start, omega=omega))


def set_rate_error(perturbed: PerturbedLoop, error: Values) -> PerturbedLoop:
    """The case with its initial (ω1, ω2) off the reference of the nominal law, rad/s."""
    law = cast(AbstractBacksteppingLaw, controller_of(perturbed.nominal))
    reference = law.reference_rate(perturbed.start)
    omega = jnp.concatenate([reference + error, perturbed.start.omega[2:]])
    return set_omega(perturbed, omega)


def _with_attitude(perturbed: PerturbedLoop, attitude: AbstractAttitude) -> PerturbedLoop:
    forms = {WZ: "as_wz", Quaternion: "as_quaternion", DCM: "as_dcm"}
    same = getattr(attitude, forms[type(perturbed.start.attitude)])()
    return perturbed._replace(start=dataclasses.replace(perturbed.start, attitude=same))
