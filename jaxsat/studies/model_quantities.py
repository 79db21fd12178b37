"""Dispersible quantities of the body, of the controller's model, and of the start."""

import dataclasses
from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxsat.control.controller import AbstractBacksteppingLaw
from jaxsat.core import ranges
from jaxsat.core.array_types import Matrix
from jaxsat.core.attitude import DCM, WZ, AbstractAttitude, Quaternion
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.simulation.loops import AbstractLoop, parts_of
from jaxsat.spacecraft.dispersible import Limits
from jaxsat.spacecraft.environment.disturbances import ConstantTorque, SumOfDisturbances
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.sensors import turned_slightly
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.studies.changes import (
    Obstacle,
    PerturbedLoop,
    Quantity,
    Values,
    between,
    changing,
    controller_of,
    fixed,
    in_loop,
    map_parts,
    needs_torque_level,
    rotors_of,
    with_controller,
)

STATE = ranges.Range(-ranges.STATE_LIMIT, ranges.STATE_LIMIT)
"""Range of rates (rad/s) and angles (rad) within which a run continues."""

_INERTIA = attrgetter("plant.spacecraft.inertia")


def _scaled(inertia: Matrix, change: Values) -> Matrix:
    """J_ij √((1 + change_i)(1 + change_j)), NaN for a negative factor."""
    root = jnp.sqrt(1 + change)
    return inertia * root[:, None] * root[None, :]


def _with_inertia(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    return in_loop(perturbed, _INERTIA, _scaled(_INERTIA(perturbed.loop), change))


def _with_products(perturbed: PerturbedLoop, share: Values) -> PerturbedLoop:
    xy, xz, yz = share * jnp.min(perturbed.nominal.plant.spacecraft.moments)
    zero = jnp.zeros_like(xy)
    extra = jnp.stack([zero, xy, xz, xy, zero, yz, xz, yz, zero]).reshape(3, 3)
    return in_loop(perturbed, _INERTIA, _INERTIA(perturbed.loop) + extra)


def _products_limits(loop: AbstractLoop) -> Limits:
    """Jij² < Ji Jj, else some axis has a negative moment; other conditions are checked draw by
    draw."""
    spacecraft = loop.plant.spacecraft
    xp, inertia, moments = numpy_if_known(spacecraft.inertia, spacecraft.moments)
    first, second = np.array([0, 0, 1]), np.array([1, 2, 2])
    widest = xp.sqrt(moments[first] * moments[second])
    least, products = xp.min(moments), inertia[first, second]
    return Limits((-widest - products) / least, (widest - products) / least)


def _with_constant_torque(perturbed: PerturbedLoop, torque: Values) -> PerturbedLoop:
    disturbance = SumOfDisturbances((perturbed.loop.plant.disturbance, ConstantTorque(torque)))
    return in_loop(perturbed, lambda loop: loop.plant.disturbance, disturbance)


def _constant_torque_limits(loop: AbstractLoop) -> Limits:
    terms = [term.torque for term in parts_of(ConstantTorque, loop.plant.disturbance)]
    nominal = sum(terms, as_float(np.zeros(3)))
    return Limits(ranges.TORQUE.low - nominal, ranges.TORQUE.high - nominal)


def _with_belief(perturbed: PerturbedLoop, kind: type, change: Callable) -> PerturbedLoop:
    controller = map_parts(
        lambda part: change(part) if isinstance(part, kind) else part,
        kind,
        controller_of(perturbed.loop),
    )
    return perturbed._replace(loop=with_controller(perturbed.loop, controller))


def _with_believed_inertia(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    """Apply the change to the inertia with wheels locked."""
    rotors = rotors_of(perturbed.nominal)

    def changed(part: Spacecraft) -> Spacecraft:
        return Spacecraft(_scaled(part.inertia + rotors, change) - rotors)

    return _with_belief(perturbed, Spacecraft, changed)


def _with_believed_orbit_rate(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    def changed(orbit):
        return eqx.tree_at(lambda o: o.rate, orbit, orbit.rate * (1 + change[0]))

    return _with_belief(perturbed, AbstractOrbit, changed)


def _needs_model(kind: type) -> Obstacle:
    def obstacle(loop: AbstractLoop) -> str | None:
        if not parts_of(kind, controller_of(loop)):
            return "the controller has no model of the plant"
        return needs_torque_level(loop)

    return obstacle


def _with_attitude(perturbed: PerturbedLoop, attitude: AbstractAttitude) -> PerturbedLoop:
    forms = {WZ: "as_wz", Quaternion: "as_quaternion", DCM: "as_dcm"}
    same = getattr(attitude, forms[type(perturbed.start.attitude)])()
    return perturbed._replace(start=dataclasses.replace(perturbed.start, attitude=same))


def _of_tilt(change: Callable[[WZ, Values], WZ], values: ranges.Range) -> Quantity:
    """Quantity that changes the initial (w, z) parameters."""

    def apply(perturbed: PerturbedLoop, numbers: Values) -> PerturbedLoop:
        return _with_attitude(perturbed, change(perturbed.start.attitude.as_wz(), numbers))

    return Quantity(apply, between(values))


def _resized(wz: WZ, size: Values) -> WZ:
    return WZ(wz.w * (size[0] / jnp.sqrt(jnp.sum(wz.w**2))), wz.z)


def _redirected(wz: WZ, angle: Values) -> WZ:
    size = jnp.sqrt(jnp.sum(wz.w**2))
    return WZ(size * jnp.stack([jnp.cos(angle[0]), jnp.sin(angle[0])]), wz.z)


def _turned(perturbed: PerturbedLoop, rotation: Values) -> PerturbedLoop:
    """Turn the initial attitude by a rotation vector in body axes, rad."""
    half = jnp.sqrt(jnp.sum(rotation**2)) / 2
    stretch = jnp.where(half > 0, jnp.tan(half) / jnp.where(half > 0, half, 1.0), 1.0)
    return _with_attitude(perturbed, turned_slightly(perturbed.start.attitude, stretch * rotation))


def _with_omega(perturbed: PerturbedLoop, omega: Values) -> PerturbedLoop:
    return perturbed._replace(start=dataclasses.replace(perturbed.start, omega=omega))


def _omega_limits(loop: AbstractLoop) -> Limits:
    """Limits of the initial rate; a held third rate starts at zero, and stays there."""
    third = 0.0 if loop.plant.third_rate_held else ranges.STATE_LIMIT
    largest = np.array([ranges.STATE_LIMIT, ranges.STATE_LIMIT, third])
    return Limits(as_float(-largest), as_float(largest))


def _with_rate_error(perturbed: PerturbedLoop, error: Values) -> PerturbedLoop:
    """Set the initial (ω1, ω2) to the nominal law's reference plus an error, rad/s."""
    law = cast(AbstractBacksteppingLaw, controller_of(perturbed.nominal))
    reference = law.reference_rate(perturbed.start)
    return _with_omega(perturbed, jnp.concatenate([reference + error, perturbed.start.omega[2:]]))


def _needs_reference(loop: AbstractLoop) -> str | None:
    law = isinstance(controller_of(loop), AbstractBacksteppingLaw)
    return None if law else "the controller has no reference rate of its own"


MODEL_QUANTITIES: Mapping[str, Quantity] = {
    "inertia": Quantity(
        _with_inertia,
        changing(ranges.MOMENT, attrgetter("plant.spacecraft.moments")),
        fixed(3),
        needs_torque_level,
    ),
    "products_of_inertia": Quantity(_with_products, _products_limits, fixed(3), needs_torque_level),
    "constant_torque": Quantity(_with_constant_torque, _constant_torque_limits, fixed(3)),
    "model_inertia": Quantity(
        _with_believed_inertia,
        changing(ranges.MOMENT, lambda loop: parts_of(Spacecraft, controller_of(loop))[0].moments),
        fixed(3),
        _needs_model(Spacecraft),
    ),
    "model_orbit_rate": Quantity(
        _with_believed_orbit_rate,
        changing(
            ranges.ORBIT_RATE,
            lambda loop: parts_of(AbstractOrbit, controller_of(loop))[0].rate[None],
        ),
        obstacle=_needs_model(AbstractOrbit),
    ),
    "attitude": Quantity(
        lambda perturbed, q: _with_attitude(perturbed, Quaternion(q)),
        between(ranges.Range(-1.0, 1.0)),
        fixed(4),
    ),
    "tilt": _of_tilt(_resized, ranges.Range(0.0, ranges.STATE_LIMIT)),
    "tilt_direction": _of_tilt(_redirected, ranges.ANGLE),
    "turn": _of_tilt(lambda wz, turn: WZ(wz.w, turn[0]), STATE),
    "attitude_error": Quantity(_turned, between(ranges.ROTATION), fixed(3)),
    "omega": Quantity(_with_omega, _omega_limits, fixed(3)),
    "rate_error": Quantity(_with_rate_error, between(STATE), fixed(2), _needs_reference),
}
