"""How many numbers each dispersible quantity takes, and where they go in the model."""

from collections.abc import Callable
from typing import NamedTuple

import jaxsat.core.ranges as ranges
from jaxsat.core.attitude import WZ
from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS, EFFECTORS
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.ranges import STATE_LIMIT, Range
from jaxsat.simulation import AbstractLoop
from jaxsat.simulation.parts import failures_of
from jaxsat.spacecraft import AbstractEffector, Spacecraft
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.environment import AbstractOrbit
from jaxsat.studies import changes, limits, part_changes
from jaxsat.studies import part_changes as sensor_changes
from jaxsat.studies.obstacles import (
    always,
    needs_delay,
    needs_effector,
    needs_failures,
    needs_latency,
    needs_model,
    needs_navigation,
    needs_outage,
    needs_periodic,
    needs_reference,
    needs_sensors,
    needs_thrusters,
    needs_torque_level,
)
from jaxsat.studies.part_changes import set_in_effector, thruster_count, thrusters_of
from jaxsat.studies.perturbed import PerturbedLoop, Values, effector_of


class Quantity(NamedTuple):
    """What a quantity of `jaxsat.core.declaration.quantities` takes and does.

    `apply` puts the numbers into the model. `obstacle` tells, as a clause, why a loop has no such
    quantity, or None. `limits` are the least and the largest number that may be drawn for it, given
    the nominal loop, so that what comes of it stays in its range (`jaxsat.core.ranges`).
    """

    size: Callable[[AbstractLoop], int]
    apply: Callable[[PerturbedLoop, Values], PerturbedLoop]
    obstacle: Callable[[AbstractLoop], str | None]
    limits: Callable[[AbstractLoop], limits.Limits]


def _fixed(size: int) -> Callable[[AbstractLoop], int]:
    return lambda loop: size


def _thrusters(each: int) -> Callable[[AbstractLoop], int]:
    def size(loop: AbstractLoop) -> int:
        (thrusters,) = thrusters_of(loop)
        return each * thruster_count(thrusters)

    return size


def _failures(part: str | None = None) -> Callable[[AbstractLoop], int]:
    """One number for each failure of an actuator of that kind, or of any."""
    return lambda loop: sum(one.count for one in failures_of(loop) if part in (None, one.part))


def _of_effector(kind: type[AbstractEffector], one: Dispersible) -> Quantity:
    """What an effector declares, where the spacecraft has it."""

    def size(loop: AbstractLoop) -> int:
        effector = loop.plant.find(kind)
        return 0 if effector is None else one.each * effector.count

    return Quantity(
        size,
        set_in_effector(kind, one),
        needs_effector(kind, one.obstacle),
        lambda loop: one.limits(effector_of(loop, kind)),
    )


def _of_failed(actuator: ActuatorDeclaration) -> Quantity:
    """The number of what fails."""
    number = (
        limits.of_failed_thruster
        if actuator.maker is None
        else lambda loop: limits.of_failed(actuator.effector)(loop)
    )
    return Quantity(
        _failures(actuator.name),
        part_changes.set_failure(actuator.name),
        needs_failures(actuator.name),
        number,
    )


_FROM_NOW = Range(0.0, ranges.SECONDS.high)


def _of_gyro(field: str, size: int, values: Range) -> Quantity:
    return Quantity(
        _fixed(size), sensor_changes.set_gyro(field), needs_navigation, limits.between(values)
    )


def _of_tracker(
    field: str, values: Range, obstacle: Callable[[AbstractLoop], str | None] = needs_navigation
) -> Quantity:
    return Quantity(_fixed(1), sensor_changes.set_tracker(field), obstacle, limits.between(values))


_QUANTITIES: dict[str, Quantity] = {
    "inertia": Quantity(
        _fixed(3),
        changes.set_inertia,
        needs_torque_level,
        limits.changing(ranges.MOMENT, limits.moments_of),
    ),
    "products_of_inertia": Quantity(
        _fixed(3), changes.set_products, needs_torque_level, limits.of_products
    ),
    "misalignment": Quantity(
        _thrusters(2),
        part_changes.set_misalignment,
        needs_thrusters,
        limits.between(ranges.MISALIGNMENT),
    ),
    "torque_gain": Quantity(
        _thrusters(1),
        part_changes.set_torque_gain,
        needs_thrusters,
        limits.between(ranges.CHANGE_OF_TORQUE),
    ),
    "disturbance_amplitude": Quantity(
        _fixed(3),
        changes.set_periodic("amplitude", lambda old, change: old * (1 + change)),
        needs_periodic,
        limits.changing(ranges.TORQUE, lambda loop: limits.periodic_of(loop).amplitude),
    ),
    "disturbance_frequency": Quantity(
        _fixed(3),
        changes.set_periodic("frequency", lambda old, change: old * (1 + change)),
        needs_periodic,
        limits.changing(ranges.FREQUENCY, lambda loop: limits.periodic_of(loop).frequency),
    ),
    "disturbance_phase": Quantity(
        _fixed(3),
        changes.set_periodic("phase", lambda old, phase: phase),
        needs_periodic,
        limits.between(ranges.ANGLE),
    ),
    "constant_torque": Quantity(
        _fixed(3), changes.set_constant_torque, always, limits.of_constant_torque
    ),
    "model_inertia": Quantity(
        _fixed(3),
        changes.set_model_inertia,
        needs_model(Spacecraft),
        limits.changing(ranges.MOMENT, limits.believed_moments),
    ),
    "model_orbit_rate": Quantity(
        _fixed(1),
        changes.set_model_orbit_rate,
        needs_model(AbstractOrbit),
        limits.changing(ranges.ORBIT_RATE, limits.believed_orbit_rate),
    ),
    "rate_noise": Quantity(
        _fixed(1),
        sensor_changes.set_sensor("rate_noise"),
        needs_sensors,
        limits.between(ranges.RATE_NOISE),
    ),
    "attitude_noise": Quantity(
        _fixed(1),
        sensor_changes.set_sensor("attitude_noise"),
        needs_sensors,
        limits.between(ranges.ATTITUDE_NOISE),
    ),
    "gyro_noise_density": _of_gyro("noise_density", 1, ranges.RATE_NOISE),
    "gyro_bias_walk": _of_gyro("bias_walk", 1, ranges.RATE_NOISE),
    "gyro_bias": _of_gyro("bias", 3, ranges.GYRO_BIAS),
    "gyro_scale_factor": _of_gyro("scale_factor", 3, ranges.SCALE_FACTOR),
    "gyro_misalignment": _of_gyro("misalignment", 3, ranges.MISALIGNMENT),
    "tracker_across": _of_tracker("across", ranges.TRACKER_NOISE),
    "tracker_along": _of_tracker("along", ranges.TRACKER_NOISE),
    "tracker_update_period": Quantity(
        _fixed(1),
        sensor_changes.set_tracker_samples("every", 1),
        needs_navigation,
        limits.of_update_period,
    ),
    "tracker_latency": Quantity(
        _fixed(1),
        sensor_changes.set_tracker_samples("arrival", 0),
        needs_latency,
        limits.of_latency,
    ),
    "tracker_rate_limit": _of_tracker("rate_limit", ranges.RATE_RANGE),
    "tracker_outage_start": _of_tracker("outage_start", _FROM_NOW, needs_outage),
    "tracker_outage": _of_tracker("outage", _FROM_NOW, needs_outage),
    "failure_time": Quantity(
        _failures(), part_changes.set_failure("at"), needs_failures(), limits.between(_FROM_NOW)
    ),
    "failure_kind": Quantity(
        _failures(), part_changes.set_failure("kind"), needs_failures(), limits.of_failure_kind
    ),
    "failure_amount": Quantity(
        _failures(), part_changes.set_failure("amount"), needs_failures(), limits.of_failure_amount
    ),
    "delay": Quantity(_fixed(1), sensor_changes.set_delay, needs_delay, limits.of_delay),
    "attitude": Quantity(_fixed(4), changes.set_attitude, always, limits.between(Range(-1.0, 1.0))),
    "tilt": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.resized),
        always,
        limits.between(Range(0.0, STATE_LIMIT)),
    ),
    "tilt_direction": Quantity(
        _fixed(1), changes.set_tilt_by(changes.redirected), always, limits.between(ranges.ANGLE)
    ),
    "turn": Quantity(
        _fixed(1),
        changes.set_tilt_by(lambda wz, turn: WZ(wz.w, turn[0])),
        always,
        limits.between(limits.STATE),
    ),
    "attitude_error": Quantity(
        _fixed(3), changes.set_attitude_error, always, limits.between(ranges.ROTATION)
    ),
    "omega": Quantity(_fixed(3), changes.set_omega, always, limits.of_omega),
    "rate_error": Quantity(
        _fixed(2), changes.set_rate_error, needs_reference, limits.between(limits.STATE)
    ),
    **{
        name: _of_effector(actuator.effector, one)
        for actuator in EFFECTORS
        for name, one in actuator.effector.dispersible.items()
    },
    **{actuator.failed_quantity.name: _of_failed(actuator) for actuator in ACTUATORS},
}

_ORDER = tuple(DISPERSIBLE)

QUANTITIES = dict(sorted(_QUANTITIES.items(), key=lambda item: _ORDER.index(item[0])))
"""By name, in the order in which they are applied."""
