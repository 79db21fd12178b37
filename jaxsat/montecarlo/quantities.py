"""What a study can disperse, by name: how many numbers it takes and where they go in the model."""

from collections.abc import Callable
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.attitude import DCM, WZ, AbstractAttitude, Quaternion
from jaxsat.control import AbstractBacksteppingLaw, InternalModel
from jaxsat.dynamics import PlantState
from jaxsat.environment import (
    AbstractOrbit,
    ConstantTorque,
    PeriodicTorque,
    SumOfDisturbances,
)
from jaxsat.simulation import AbstractLoop, ContinuousLoop, ErrorCoordinateLoop, SampledLoop
from jaxsat.vehicle import Sensors, Spacecraft
from jaxsat.vehicle.sensors import turned_slightly


class Setting(NamedTuple):
    """A closed loop and its start, as far as they have been dispersed, and the nominal loop."""

    loop: AbstractLoop
    start: PlantState
    nominal: AbstractLoop


Values = Float[Array, " size"]


class Quantity(NamedTuple):
    """A dispersible quantity.

    `apply` puts the numbers into the model. `obstacle` tells, as a clause, why a loop has no such
    quantity, or None.
    """

    unit: str
    meaning: str
    size: Callable[[AbstractLoop], int]
    apply: Callable[[Setting, Values], Setting]
    obstacle: Callable[[AbstractLoop], str | None]


def controller_of(loop: AbstractLoop):
    """The controller of any loop."""
    return loop.law if isinstance(loop, ErrorCoordinateLoop) else _with_thrusters(loop).controller


def _with_thrusters(loop: AbstractLoop) -> ContinuousLoop | SampledLoop:
    """The loop as one of those that have actuators, which `obstacle` has made sure of."""
    return cast(ContinuousLoop | SampledLoop, loop)


def with_controller(loop: AbstractLoop, controller) -> AbstractLoop:
    """The loop with another controller."""
    return eqx.tree_at(controller_of, loop, controller)


def possible_inertia(inertia: Float[Array, "3 3"]) -> Bool[Array, ""]:
    """Whether a body of positive mass density can have this inertia: ½ tr(J) I - J > 0.

    The triangle inequality of the principal moments in the form that products of inertia leave
    simple; it implies J > 0. By leading minors.
    """
    second = jnp.trace(inertia) / 2 * jnp.eye(3, dtype=inertia.dtype) - inertia
    two = second[0, 0] * second[1, 1] - second[0, 1] * second[1, 0]
    three = jnp.dot(second[0], jnp.cross(second[1], second[2]))
    return (second[0, 0] > 0) & (two > 0) & (three > 0)


def scaled_inertia(inertia: Float[Array, "3 3"], change: Values) -> Float[Array, "3 3"]:
    """J_ij √((1 + change_i)(1 + change_j)), which is no number where a factor is negative."""
    root = jnp.sqrt(1 + change)
    return inertia * root[:, None] * root[None, :]


def _inertia(setting: Setting, change: Values) -> Setting:
    return _in_loop(
        setting,
        lambda loop: loop.plant.spacecraft.inertia,
        scaled_inertia(setting.loop.plant.spacecraft.inertia, change),
    )


def _products(setting: Setting, share: Values) -> Setting:
    smallest = jnp.min(setting.nominal.plant.spacecraft.moments)
    xy, xz, yz = share * smallest
    zero = jnp.zeros_like(xy)
    extra = jnp.stack(
        [jnp.stack([zero, xy, xz]), jnp.stack([xy, zero, yz]), jnp.stack([xz, yz, zero])]
    )
    return _in_loop(
        setting,
        lambda loop: loop.plant.spacecraft.inertia,
        setting.loop.plant.spacecraft.inertia + extra,
    )


def _misalignment(setting: Setting, angles: Values) -> Setting:
    actuators = _with_thrusters(setting.loop).actuators
    count = actuators.torque_axes.shape[1]
    turned = actuators.misaligned(angles.reshape(count, 2), jnp.zeros(count, angles.dtype))
    return _in_loop(setting, lambda loop: loop.actuators, turned)


def _torque_gain(setting: Setting, change: Values) -> Setting:
    axes = _with_thrusters(setting.loop).actuators.torque_axes * (1 + change)[None, :]
    return _in_loop(setting, lambda loop: loop.actuators.torque_axes, axes)


def _periodic(field: str, new: Callable[[Array, Values], Array]):
    def apply(setting: Setting, values: Values) -> Setting:
        def change(term):
            if not isinstance(term, PeriodicTorque):
                return term
            return eqx.tree_at(lambda t: getattr(t, field), term, new(getattr(term, field), values))

        disturbance = _map(change, PeriodicTorque, setting.loop.plant.disturbance)
        return _in_loop(setting, lambda loop: loop.plant.disturbance, disturbance)

    return apply


def follow_frequency(loop: AbstractLoop) -> AbstractLoop:
    """The loop whose internal model knows the frequencies of the plant's periodic torque."""
    (torque,) = _found(PeriodicTorque, loop.plant.disturbance)

    def change(part):
        known = isinstance(part, InternalModel)
        return InternalModel(torque.frequency[:2]) if known else part

    return with_controller(loop, _map(change, InternalModel, controller_of(loop)))


def _constant_torque(setting: Setting, torque: Values) -> Setting:
    disturbance = SumOfDisturbances((setting.loop.plant.disturbance, ConstantTorque(torque)))
    return _in_loop(setting, lambda loop: loop.plant.disturbance, disturbance)


def _model_inertia(setting: Setting, change: Values) -> Setting:
    def changed(part):
        known = isinstance(part, Spacecraft)
        return Spacecraft(scaled_inertia(part.inertia, change)) if known else part

    controller = _map(changed, Spacecraft, controller_of(setting.loop))
    return setting._replace(loop=with_controller(setting.loop, controller))


def _model_orbit_rate(setting: Setting, change: Values) -> Setting:
    def changed(part):
        known = isinstance(part, AbstractOrbit)
        return eqx.tree_at(lambda o: o.rate, part, part.rate * (1 + change[0])) if known else part

    controller = _map(changed, AbstractOrbit, controller_of(setting.loop))
    return setting._replace(loop=with_controller(setting.loop, controller))


def _sensor(field: str):
    def apply(setting: Setting, sigma: Values) -> Setting:
        return _in_loop(setting, lambda loop: getattr(loop.sensors, field), sigma[0])

    return apply


def _delay(setting: Setting, delay: Values) -> Setting:
    return _in_loop(setting, lambda loop: loop.delay, delay[0])


def _attitude(setting: Setting, q: Values) -> Setting:
    return _with_attitude(setting, Quaternion(q))


def _tilt(change: Callable[[WZ, Values], WZ]):
    def apply(setting: Setting, values: Values) -> Setting:
        return _with_attitude(setting, change(setting.start.attitude.as_wz(), values))

    return apply


def _resized(wz: WZ, size: Values) -> WZ:
    return WZ(wz.w * (size[0] / jnp.sqrt(jnp.sum(wz.w**2))), wz.z)


def _redirected(wz: WZ, angle: Values) -> WZ:
    size = jnp.sqrt(jnp.sum(wz.w**2))
    return WZ(size * jnp.stack([jnp.cos(angle[0]), jnp.sin(angle[0])]), wz.z)


def _attitude_error(setting: Setting, rotation: Values) -> Setting:
    half = jnp.sqrt(jnp.sum(rotation**2)) / 2
    stretch = jnp.where(half > 0, jnp.tan(half) / jnp.where(half > 0, half, 1.0), 1.0)
    return _with_attitude(setting, turned_slightly(setting.start.attitude, stretch * rotation))


def _omega(setting: Setting, omega: Values) -> Setting:
    return setting._replace(start=PlantState(setting.start.attitude, omega))


def _rate_error(setting: Setting, error: Values) -> Setting:
    law = cast(AbstractBacksteppingLaw, controller_of(setting.nominal))
    reference = law.reference_rate(setting.start)
    omega = jnp.concatenate([reference + error, setting.start.omega[2:]])
    return _omega(setting, omega)


def _with_attitude(setting: Setting, attitude: AbstractAttitude) -> Setting:
    forms = {WZ: "as_wz", Quaternion: "as_quaternion", DCM: "as_dcm"}
    same = getattr(attitude, forms[type(setting.start.attitude)])()
    return setting._replace(start=PlantState(same, setting.start.omega))


def _in_loop(setting: Setting, where, new) -> Setting:
    return setting._replace(loop=eqx.tree_at(where, setting.loop, new))


def _map(change, kind: type, tree):
    return jax.tree.map(change, tree, is_leaf=lambda part: isinstance(part, kind))


def _found(kind: type, tree) -> list:
    parts = jax.tree.leaves(tree, is_leaf=lambda part: isinstance(part, kind))
    return [part for part in parts if isinstance(part, kind)]


def _always(loop: AbstractLoop) -> None:
    del loop


def _needs_torque_level(loop: AbstractLoop) -> str | None:
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


def _needs_periodic(loop: AbstractLoop) -> str | None:
    count = len(_found(PeriodicTorque, loop.plant.disturbance))
    return None if count == 1 else f"the plant has {count} periodic disturbance torques, not one"


def _needs_model(kind: type) -> Callable[[AbstractLoop], str | None]:
    def obstacle(loop: AbstractLoop) -> str | None:
        if not _found(kind, controller_of(loop)):
            return "the controller has no model of the plant"
        return _needs_torque_level(loop)

    return obstacle


def _needs_sensors(loop: AbstractLoop) -> str | None:
    if not isinstance(loop, SampledLoop):
        return "only sampled loops have sensors"
    return None if isinstance(loop.sensors, Sensors) else "the loop has no sensors"


def _needs_delay(loop: AbstractLoop) -> str | None:
    delayed = isinstance(loop, SampledLoop) and loop.delay is not None
    return None if delayed else "the loop has no delay"


def _needs_reference(loop: AbstractLoop) -> str | None:
    law = isinstance(controller_of(loop), AbstractBacksteppingLaw)
    return None if law else "the controller has no reference rate of its own"


def _fixed(size: int) -> Callable[[AbstractLoop], int]:
    return lambda loop: size


def _thrusters(each: int) -> Callable[[AbstractLoop], int]:
    return lambda loop: each * _with_thrusters(loop).actuators.torque_axes.shape[1]


QUANTITIES: dict[str, Quantity] = {
    "inertia": Quantity(
        "1", "relative change of J1, J2, J3", _fixed(3), _inertia, _needs_torque_level
    ),
    "products_of_inertia": Quantity(
        "1",
        "Jxy, Jxz, Jyz to add, in parts of the least of J1, J2, J3",
        _fixed(3),
        _products,
        _needs_torque_level,
    ),
    "misalignment": Quantity(
        "rad",
        "turn of each torque axis towards two directions across it",
        _thrusters(2),
        _misalignment,
        _needs_torque_level,
    ),
    "torque_gain": Quantity(
        "1",
        "relative change of each thruster's torque",
        _thrusters(1),
        _torque_gain,
        _needs_torque_level,
    ),
    "disturbance_amplitude": Quantity(
        "1",
        "relative change of the periodic torque's amplitudes",
        _fixed(3),
        _periodic("amplitude", lambda old, change: old * (1 + change)),
        _needs_periodic,
    ),
    "disturbance_frequency": Quantity(
        "1",
        "relative change of the periodic torque's frequencies",
        _fixed(3),
        _periodic("frequency", lambda old, change: old * (1 + change)),
        _needs_periodic,
    ),
    "disturbance_phase": Quantity(
        "rad",
        "phases of the periodic torque",
        _fixed(3),
        _periodic("phase", lambda old, phase: phase),
        _needs_periodic,
    ),
    "constant_torque": Quantity(
        "N m", "torque to add, fixed in body axes", _fixed(3), _constant_torque, _always
    ),
    "model_inertia": Quantity(
        "1",
        "relative change of the J1, J2, J3 that the controller believes",
        _fixed(3),
        _model_inertia,
        _needs_model(Spacecraft),
    ),
    "model_orbit_rate": Quantity(
        "1",
        "relative change of the orbit rate that the controller believes",
        _fixed(1),
        _model_orbit_rate,
        _needs_model(AbstractOrbit),
    ),
    "rate_noise": Quantity(
        "rad/s",
        "standard deviation of the rate sensors",
        _fixed(1),
        _sensor("rate_noise"),
        _needs_sensors,
    ),
    "attitude_noise": Quantity(
        "rad",
        "standard deviation of the attitude sensors",
        _fixed(1),
        _sensor("attitude_noise"),
        _needs_sensors,
    ),
    "delay": Quantity(
        "s", "time that the controller takes to compute", _fixed(1), _delay, _needs_delay
    ),
    "attitude": Quantity("1", "initial attitude, a unit quaternion", _fixed(4), _attitude, _always),
    "tilt": Quantity("1", "initial |w|", _fixed(1), _tilt(_resized), _always),
    "tilt_direction": Quantity(
        "rad", "angle of the initial (w1, w2)", _fixed(1), _tilt(_redirected), _always
    ),
    "turn": Quantity(
        "rad",
        "initial z",
        _fixed(1),
        _tilt(lambda wz, turn: WZ(wz.w, turn[0])),
        _always,
    ),
    "attitude_error": Quantity(
        "rad",
        "rotation vector, body axes, from the nominal initial attitude",
        _fixed(3),
        _attitude_error,
        _always,
    ),
    "omega": Quantity("rad/s", "initial angular velocity", _fixed(3), _omega, _always),
    "rate_error": Quantity(
        "rad/s",
        "initial (ω1, ω2) less the reference of the nominal law",
        _fixed(2),
        _rate_error,
        _needs_reference,
    ),
}
"""In the order in which they are applied."""
