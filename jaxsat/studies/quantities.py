"""How many numbers each dispersible quantity takes, and where they go in the model."""

from collections.abc import Callable
from typing import NamedTuple

import jaxsat.core.ranges as ranges
from jaxsat.core.attitude import WZ
from jaxsat.core.ranges import STATE_LIMIT, Range
from jaxsat.simulation import AbstractLoop
from jaxsat.simulation.parts import failures_of
from jaxsat.spacecraft import (
    AbstractEffector,
    ControlMomentGyros,
    FailureEvents,
    GimbalFailures,
    MagnetorquerFailures,
    Magnetorquers,
    Spacecraft,
    WheelFailures,
    Wheels,
)
from jaxsat.spacecraft.environment import AbstractOrbit
from jaxsat.studies import changes, limits, part_changes
from jaxsat.studies import part_changes as sensor_changes
from jaxsat.studies.obstacles import (
    ANY_FAILURE,
    always,
    needs,
    needs_delay,
    needs_failures,
    needs_latency,
    needs_model,
    needs_navigation,
    needs_outage,
    needs_periodic,
    needs_reference,
    needs_rotors,
    needs_sensors,
    needs_thrusters,
    needs_torque_level,
)
from jaxsat.studies.part_changes import thruster_count, thrusters_of
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


def _failures(*kinds: type) -> Callable[[AbstractLoop], int]:
    return lambda loop: sum(one.count for one in failures_of(loop) if isinstance(one, kinds))


def _devices(kind: type[AbstractEffector], each: int = 1) -> Callable[[AbstractLoop], int]:
    """So many numbers for each device of an effector; none where there is no such effector."""

    def size(loop: AbstractLoop) -> int:
        effector = loop.plant.find(kind)
        return 0 if effector is None else each * effector.count

    return size


_FROM_NOW = Range(0.0, ranges.SECONDS.high)


def _of_gyro(field: str, size: int, values: Range) -> Quantity:
    return Quantity(
        _fixed(size), sensor_changes.set_gyro(field), needs_navigation, limits.between(values)
    )


def _of_tracker(
    field: str, values: Range, obstacle: Callable[[AbstractLoop], str | None] = needs_navigation
) -> Quantity:
    return Quantity(_fixed(1), sensor_changes.set_tracker(field), obstacle, limits.between(values))


QUANTITIES: dict[str, Quantity] = {
    "inertia": Quantity(
        _fixed(3),
        changes.set_inertia,
        needs_torque_level,
        limits.changing(ranges.MOMENT, limits.moments_of),
    ),
    "products_of_inertia": Quantity(
        _fixed(3),
        changes.set_products,
        needs_torque_level,
        limits.of_products,
    ),
    "rotor_inertia": Quantity(
        _devices(Wheels),
        changes.set_rotor_inertia,
        needs_rotors,
        limits.changing(ranges.MOMENT, limits.rotors_of),
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
    "dipole_limit": Quantity(
        _devices(Magnetorquers),
        part_changes.set_dipole_limit,
        needs(Magnetorquers),
        limits.changing(
            ranges.DIPOLE_LIMIT, lambda loop: effector_of(loop, Magnetorquers).dipole_limit
        ),
    ),
    "magnetorquer_misalignment": Quantity(
        _devices(Magnetorquers, 2),
        part_changes.set_torquer_misalignment,
        needs(Magnetorquers),
        limits.between(ranges.MISALIGNMENT),
    ),
    "rotor_momentum": Quantity(
        _devices(ControlMomentGyros),
        part_changes.set_rotor_momentum,
        needs(ControlMomentGyros),
        limits.changing(
            ranges.WHEEL_MOMENTUM, lambda loop: effector_of(loop, ControlMomentGyros).rotor_momentum
        ),
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
        _fixed(3),
        changes.set_constant_torque,
        always,
        limits.of_constant_torque,
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
        _failures(*ANY_FAILURE),
        part_changes.set_failure("at"),
        needs_failures(*ANY_FAILURE),
        limits.between(_FROM_NOW),
    ),
    "failed_thruster": Quantity(
        _failures(FailureEvents),
        part_changes.set_failure("thruster"),
        needs_failures(FailureEvents),
        limits.of_failed_thruster,
    ),
    "failed_wheel": Quantity(
        _failures(WheelFailures),
        part_changes.set_failure("wheel"),
        needs_failures(WheelFailures),
        limits.of_failed(Wheels),
    ),
    "failed_magnetorquer": Quantity(
        _failures(MagnetorquerFailures),
        part_changes.set_failure("magnetorquer"),
        needs_failures(MagnetorquerFailures),
        limits.of_failed(Magnetorquers),
    ),
    "failed_gimbal": Quantity(
        _failures(GimbalFailures),
        part_changes.set_failure("gimbal"),
        needs_failures(GimbalFailures),
        limits.of_failed(ControlMomentGyros),
    ),
    "failure_kind": Quantity(
        _failures(*ANY_FAILURE),
        part_changes.set_failure("kind"),
        needs_failures(*ANY_FAILURE),
        limits.of_failure_kind,
    ),
    "failure_amount": Quantity(
        _failures(*ANY_FAILURE),
        part_changes.set_failure("amount"),
        needs_failures(*ANY_FAILURE),
        limits.of_failure_amount,
    ),
    "delay": Quantity(
        _fixed(1),
        sensor_changes.set_delay,
        needs_delay,
        limits.of_delay,
    ),
    "attitude": Quantity(
        _fixed(4),
        changes.set_attitude,
        always,
        limits.between(Range(-1.0, 1.0)),
    ),
    "tilt": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.resized),
        always,
        limits.between(Range(0.0, STATE_LIMIT)),
    ),
    "tilt_direction": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.redirected),
        always,
        limits.between(ranges.ANGLE),
    ),
    "turn": Quantity(
        _fixed(1),
        changes.set_tilt_by(lambda wz, turn: WZ(wz.w, turn[0])),
        always,
        limits.between(limits.STATE),
    ),
    "attitude_error": Quantity(
        _fixed(3),
        changes.set_attitude_error,
        always,
        limits.between(ranges.ROTATION),
    ),
    "omega": Quantity(
        _fixed(3),
        changes.set_omega,
        always,
        limits.of_omega,
    ),
    "wheel_momentum": Quantity(
        _devices(Wheels),
        changes.set_wheel_momentum,
        needs(Wheels),
        limits.of_wheel_momentum,
    ),
    "rate_error": Quantity(
        _fixed(2),
        changes.set_rate_error,
        needs_reference,
        limits.between(limits.STATE),
    ),
}
"""By name, in the order of `DISPERSIBLE`, in which they are applied."""
