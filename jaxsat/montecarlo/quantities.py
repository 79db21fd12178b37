"""How many numbers each dispersible quantity takes, and where they go in the model."""

from collections.abc import Callable
from typing import NamedTuple

from jaxsat import ranges
from jaxsat.attitude import WZ
from jaxsat.control import AbstractBacksteppingLaw
from jaxsat.environment import AbstractOrbit, PeriodicTorque
from jaxsat.montecarlo import changes, limits
from jaxsat.montecarlo.changes import (
    PerturbedLoop,
    Values,
    controller_of,
    navigation_of,
    thruster_count,
    thrusters_of,
    torquers_of,
)
from jaxsat.ranges import STATE_LIMIT, Range
from jaxsat.simulation import AbstractLoop, ErrorCoordinateLoop, SampledLoop
from jaxsat.simulation.parts import failures_of, parts_of
from jaxsat.vehicle import (
    FailureEvents,
    MagnetorquerFailures,
    Sensors,
    Spacecraft,
    WheelFailures,
)


class Quantity(NamedTuple):
    """What a quantity of `jaxsat.declaration.quantities` takes and does.

    `apply` puts the numbers into the model. `obstacle` tells, as a clause, why a loop has no such
    quantity, or None. `limits` are the least and the largest number that may be drawn for it, given
    the nominal loop, so that what comes of it stays in its range (`jaxsat.ranges`).
    """

    size: Callable[[AbstractLoop], int]
    apply: Callable[[PerturbedLoop, Values], PerturbedLoop]
    obstacle: Callable[[AbstractLoop], str | None]
    limits: Callable[[AbstractLoop], limits.Limits]


def _always(loop: AbstractLoop) -> None:
    del loop


def _needs_torque_level(loop: AbstractLoop) -> str | None:
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


def _needs_periodic(loop: AbstractLoop) -> str | None:
    count = len(parts_of(PeriodicTorque, loop.plant.disturbance))
    return None if count == 1 else f"the plant has {count} periodic disturbance torques, not one"


def _needs_model(kind: type) -> Callable[[AbstractLoop], str | None]:
    def obstacle(loop: AbstractLoop) -> str | None:
        if not parts_of(kind, controller_of(loop)):
            return "the controller has no model of the plant"
        return _needs_torque_level(loop)

    return obstacle


def _needs_sensors(loop: AbstractLoop) -> str | None:
    if not isinstance(loop, SampledLoop):
        return "only sampled loops have sensors"
    return None if isinstance(loop.sensors, Sensors) else "the loop has no sensors"


def _needs_navigation(loop: AbstractLoop) -> str | None:
    there = isinstance(loop, SampledLoop) and loop.navigation is not None
    return None if there else "the loop has no gyro and star tracker"


def _needs_latency(loop: AbstractLoop) -> str | None:
    obstacle = _needs_navigation(loop)
    if obstacle is None and not navigation_of(loop).tracker.latency:
        return "the star tracker has no latency"
    return obstacle


def _needs_outage(loop: AbstractLoop) -> str | None:
    obstacle = _needs_navigation(loop)
    if obstacle is None and navigation_of(loop).tracker.outage is None:
        return "the star tracker has no outage"
    return obstacle


def _needs_delay(loop: AbstractLoop) -> str | None:
    delayed = isinstance(loop, SampledLoop) and loop.delay is not None
    return None if delayed else "the loop has no delay"


def _needs_reference(loop: AbstractLoop) -> str | None:
    law = isinstance(controller_of(loop), AbstractBacksteppingLaw)
    return None if law else "the controller has no reference rate of its own"


def _fixed(size: int) -> Callable[[AbstractLoop], int]:
    return lambda loop: size


def _needs_thrusters(loop: AbstractLoop) -> str | None:
    obstacle = _needs_torque_level(loop)
    if obstacle is None and len(thrusters_of(loop)) != 1:
        return "the actuators are no thrusters"
    return obstacle


def _thrusters(each: int) -> Callable[[AbstractLoop], int]:
    def size(loop: AbstractLoop) -> int:
        (thrusters,) = thrusters_of(loop)
        return each * thruster_count(thrusters)

    return size


def _needs_failures(*kinds: type) -> Callable[[AbstractLoop], str | None]:
    what = {
        FailureEvents: "thruster",
        WheelFailures: "wheel",
        MagnetorquerFailures: "magnetorquer",
    }

    def obstacle(loop: AbstractLoop) -> str | None:
        if any(isinstance(one, kinds) for one in failures_of(loop)):
            return None
        which = f" of a {what[kinds[0]]}" if len(kinds) == 1 else ""
        return f"the scenario has no failure{which} in flight"

    return obstacle


def _failures(*kinds: type) -> Callable[[AbstractLoop], int]:
    return lambda loop: sum(one.count for one in failures_of(loop) if isinstance(one, kinds))


_ANY_FAILURE = (FailureEvents, WheelFailures, MagnetorquerFailures)


def _needs_wheels(loop: AbstractLoop) -> str | None:
    return None if loop.plant.wheels is not None else "the spacecraft has no wheels"


def _wheels(loop: AbstractLoop) -> int:
    return 0 if loop.plant.wheels is None else loop.plant.wheels.count


def _needs_magnetorquers(loop: AbstractLoop) -> str | None:
    there = loop.plant.magnetorquers is not None
    return None if there else "the spacecraft has no magnetorquers"


def _magnetorquers(each: int) -> Callable[[AbstractLoop], int]:
    return lambda loop: each * torquers_of(loop).count


_FROM_NOW = Range(0.0, ranges.SECONDS.high)


def _of_gyro(field: str, size: int, values: Range) -> Quantity:
    return Quantity(
        _fixed(size), changes.set_gyro(field), _needs_navigation, limits.between(values)
    )


def _of_tracker(
    field: str, values: Range, obstacle: Callable[[AbstractLoop], str | None] = _needs_navigation
) -> Quantity:
    return Quantity(_fixed(1), changes.set_tracker(field), obstacle, limits.between(values))


QUANTITIES: dict[str, Quantity] = {
    "inertia": Quantity(
        _fixed(3),
        changes.set_inertia,
        _needs_torque_level,
        limits.changing(ranges.MOMENT, limits.moments_of),
    ),
    "products_of_inertia": Quantity(
        _fixed(3),
        changes.set_products,
        _needs_torque_level,
        limits.of_products,
    ),
    "misalignment": Quantity(
        _thrusters(2),
        changes.set_misalignment,
        _needs_thrusters,
        limits.between(ranges.MISALIGNMENT),
    ),
    "torque_gain": Quantity(
        _thrusters(1),
        changes.set_torque_gain,
        _needs_thrusters,
        limits.between(ranges.CHANGE_OF_TORQUE),
    ),
    "dipole_limit": Quantity(
        _magnetorquers(1),
        changes.set_dipole_limit,
        _needs_magnetorquers,
        limits.changing(ranges.DIPOLE_LIMIT, lambda loop: torquers_of(loop).dipole_limit),
    ),
    "magnetorquer_misalignment": Quantity(
        _magnetorquers(2),
        changes.set_torquer_misalignment,
        _needs_magnetorquers,
        limits.between(ranges.MISALIGNMENT),
    ),
    "disturbance_amplitude": Quantity(
        _fixed(3),
        changes.set_periodic("amplitude", lambda old, change: old * (1 + change)),
        _needs_periodic,
        limits.changing(ranges.TORQUE, lambda loop: limits.periodic_of(loop).amplitude),
    ),
    "disturbance_frequency": Quantity(
        _fixed(3),
        changes.set_periodic("frequency", lambda old, change: old * (1 + change)),
        _needs_periodic,
        limits.changing(ranges.FREQUENCY, lambda loop: limits.periodic_of(loop).frequency),
    ),
    "disturbance_phase": Quantity(
        _fixed(3),
        changes.set_periodic("phase", lambda old, phase: phase),
        _needs_periodic,
        limits.between(ranges.ANGLE),
    ),
    "constant_torque": Quantity(
        _fixed(3),
        changes.set_constant_torque,
        _always,
        limits.of_constant_torque,
    ),
    "model_inertia": Quantity(
        _fixed(3),
        changes.set_model_inertia,
        _needs_model(Spacecraft),
        limits.changing(ranges.MOMENT, limits.believed_moments),
    ),
    "model_orbit_rate": Quantity(
        _fixed(1),
        changes.set_model_orbit_rate,
        _needs_model(AbstractOrbit),
        limits.changing(ranges.ORBIT_RATE, limits.believed_orbit_rate),
    ),
    "rate_noise": Quantity(
        _fixed(1),
        changes.set_sensor("rate_noise"),
        _needs_sensors,
        limits.between(ranges.RATE_NOISE),
    ),
    "attitude_noise": Quantity(
        _fixed(1),
        changes.set_sensor("attitude_noise"),
        _needs_sensors,
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
        changes.set_tracker_samples("every", 1),
        _needs_navigation,
        limits.of_update_period,
    ),
    "tracker_latency": Quantity(
        _fixed(1),
        changes.set_tracker_samples("arrival", 0),
        _needs_latency,
        limits.of_latency,
    ),
    "tracker_rate_limit": _of_tracker("rate_limit", ranges.RATE_RANGE),
    "tracker_outage_start": _of_tracker("outage_start", _FROM_NOW, _needs_outage),
    "tracker_outage": _of_tracker("outage", _FROM_NOW, _needs_outage),
    "failure_time": Quantity(
        _failures(*_ANY_FAILURE),
        changes.set_failure("at"),
        _needs_failures(*_ANY_FAILURE),
        limits.between(_FROM_NOW),
    ),
    "failed_thruster": Quantity(
        _failures(FailureEvents),
        changes.set_failure("thruster"),
        _needs_failures(FailureEvents),
        limits.of_failed_thruster,
    ),
    "failed_wheel": Quantity(
        _failures(WheelFailures),
        changes.set_failure("wheel"),
        _needs_failures(WheelFailures),
        limits.of_failed_wheel,
    ),
    "failed_magnetorquer": Quantity(
        _failures(MagnetorquerFailures),
        changes.set_failure("magnetorquer"),
        _needs_failures(MagnetorquerFailures),
        limits.of_failed_magnetorquer,
    ),
    "failure_kind": Quantity(
        _failures(*_ANY_FAILURE),
        changes.set_failure("kind"),
        _needs_failures(*_ANY_FAILURE),
        limits.of_failure_kind,
    ),
    "failure_amount": Quantity(
        _failures(*_ANY_FAILURE),
        changes.set_failure("amount"),
        _needs_failures(*_ANY_FAILURE),
        limits.of_failure_amount,
    ),
    "delay": Quantity(
        _fixed(1),
        changes.set_delay,
        _needs_delay,
        limits.of_delay,
    ),
    "attitude": Quantity(
        _fixed(4),
        changes.set_attitude,
        _always,
        limits.between(Range(-1.0, 1.0)),
    ),
    "tilt": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.resized),
        _always,
        limits.between(Range(0.0, STATE_LIMIT)),
    ),
    "tilt_direction": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.redirected),
        _always,
        limits.between(ranges.ANGLE),
    ),
    "turn": Quantity(
        _fixed(1),
        changes.set_tilt_by(lambda wz, turn: WZ(wz.w, turn[0])),
        _always,
        limits.between(limits.STATE),
    ),
    "attitude_error": Quantity(
        _fixed(3),
        changes.set_attitude_error,
        _always,
        limits.between(ranges.ROTATION),
    ),
    "omega": Quantity(
        _fixed(3),
        changes.set_omega,
        _always,
        limits.of_omega,
    ),
    "wheel_momentum": Quantity(
        _wheels,
        changes.set_wheel_momentum,
        _needs_wheels,
        limits.of_wheel_momentum,
    ),
    "rate_error": Quantity(
        _fixed(2),
        changes.set_rate_error,
        _needs_reference,
        limits.between(limits.STATE),
    ),
}
"""By name, in the order of `DISPERSIBLE`, in which they are applied."""
