"""How many numbers each dispersible quantity takes, and where they go in the model."""

import functools
import pkgutil
from collections.abc import Callable
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

import jaxsat.core.ranges as ranges
from jaxsat.core.attitude import WZ
from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS, EFFECTORS
from jaxsat.core.declaration.disturbances import DISTURBANCES
from jaxsat.core.declaration.keys import DispersibleQuantity
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.sensors import SENSED
from jaxsat.core.ranges import STATE_LIMIT, Range
from jaxsat.simulation.loops import AbstractLoop, failures_of, parts_of
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.studies import changes, limits, part_changes
from jaxsat.studies.changes import PerturbedLoop, Values, effector_of
from jaxsat.studies.part_changes import set_field, set_in_effector, thrusters_of


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
        return each * thrusters.count

    return size


def _failures(part: str | None = None) -> Callable[[AbstractLoop], int]:
    """One number for each failure of an actuator of that kind, or of any."""
    return lambda loop: sum(one.count for one in failures_of(loop) if part in (None, one.part))


def _of_field(
    one: DispersibleQuantity,
    part_of: Callable[[AbstractLoop], Any],
    obstacle: Callable[[AbstractLoop], str | None],
    lacks: str = "",
) -> Quantity:
    """A quantity that is one field of a part; `lacks` begins what is said where that is None."""
    field, within = one.field, one.within
    assert field is not None
    assert within is not None

    def nominal(loop: AbstractLoop) -> Any:
        return getattr(part_of(loop), field)

    def needs_number(loop: AbstractLoop) -> str | None:
        reason = obstacle(loop)
        if reason is None and nominal(loop) is None:
            return f"{lacks} {field.replace('_', ' ')}"
        return reason

    return Quantity(
        lambda loop: np.size(nominal(loop)),
        set_field(part_of, one),
        needs_number,
        limits.changing(within, nominal) if one.relative else limits.between(within),
    )


def _of_sensors() -> dict[str, Quantity]:
    return {
        one.name: _of_field(
            one,
            attrgetter(place),
            limits.needs_sensor(place, sensor.summary),
            f"the {sensor.summary} has no",
        )
        for place, sensor in SENSED.items()
        for one in sensor.quantities
        if one.field is not None
    }


def _of_disturbances() -> dict[str, Quantity]:
    return {
        one.name: _of_field(
            one, functools.partial(_disturbance, kind), limits.needs_disturbance(kind, part.summary)
        )
        for place, part in DISTURBANCES.items()
        for kind in [pkgutil.resolve_name(place)]
        for one in part.quantities
        if one.field is not None
    }


def _disturbance(kind: type, loop: AbstractLoop) -> Any:
    (disturbance,) = parts_of(kind, loop.plant.disturbance)
    return disturbance


def _of_effectors() -> dict[str, Quantity]:
    return {
        one.name: _of_effector(actuator.effector, one)
        for actuator in EFFECTORS
        for one in actuator.dispersible
    }


def _of_effector(kind: type[AbstractEffector], one: DispersibleQuantity) -> Quantity:
    if one.field is not None:
        obstacle, lacks = limits.needs_effector(kind), f"no {kind.kind} has a"
        return _of_field(one, lambda loop: effector_of(loop, kind), obstacle, lacks)
    own = kind.dispersible[one.name]
    return Quantity(
        lambda loop: own.each * effector_of(loop, kind).count,
        set_in_effector(kind, own),
        limits.needs_effector(kind),
        lambda loop: own.limits(effector_of(loop, kind)),
    )


def _of_failed(actuator: ActuatorDeclaration) -> Quantity:
    """The number of what fails."""
    return Quantity(
        _failures(actuator.name),
        part_changes.set_failure("number", actuator.name),
        limits.needs_failures(actuator.name),
        limits.of_failed(actuator),
    )


_QUANTITIES: dict[str, Quantity] = {
    **_of_sensors(),
    "inertia": Quantity(
        _fixed(3),
        changes.set_inertia,
        limits.needs_torque_level,
        limits.changing(ranges.MOMENT, limits.moments_of),
    ),
    "products_of_inertia": Quantity(
        _fixed(3), changes.set_products, limits.needs_torque_level, limits.of_products
    ),
    "misalignment": Quantity(
        _thrusters(2),
        part_changes.set_misalignment,
        limits.needs_thrusters,
        limits.between(ranges.MISALIGNMENT),
    ),
    "torque_gain": Quantity(
        _thrusters(1),
        part_changes.set_torque_gain,
        limits.needs_thrusters,
        limits.between(ranges.CHANGE_OF_TORQUE),
    ),
    "constant_torque": Quantity(
        _fixed(3), changes.set_constant_torque, limits.always, limits.of_constant_torque
    ),
    "model_inertia": Quantity(
        _fixed(3),
        changes.set_model_inertia,
        limits.needs_model(Spacecraft),
        limits.changing(ranges.MOMENT, limits.believed_moments),
    ),
    "model_orbit_rate": Quantity(
        _fixed(1),
        changes.set_model_orbit_rate,
        limits.needs_model(AbstractOrbit),
        limits.changing(ranges.ORBIT_RATE, limits.believed_orbit_rate),
    ),
    "tracker_update_period": Quantity(
        _fixed(1),
        part_changes.set_tracker_samples("every", 1),
        limits.needs_navigation,
        limits.of_update_period,
    ),
    "tracker_latency": Quantity(
        _fixed(1),
        part_changes.set_tracker_samples("arrival", 0),
        limits.needs_latency,
        limits.of_latency,
    ),
    "failure_time": Quantity(
        _failures(),
        part_changes.set_failure("at"),
        limits.needs_failures(),
        limits.between(ranges.FROM_ZERO),
    ),
    "failure_kind": Quantity(
        _failures(),
        part_changes.set_failure("kind"),
        limits.needs_failures(),
        limits.of_failure_kind,
    ),
    "failure_amount": Quantity(
        _failures(),
        part_changes.set_failure("amount"),
        limits.needs_failures(),
        limits.of_failure_amount,
    ),
    "delay": Quantity(_fixed(1), part_changes.set_delay, limits.needs_delay, limits.of_delay),
    "attitude": Quantity(
        _fixed(4), changes.set_attitude, limits.always, limits.between(Range(-1.0, 1.0))
    ),
    "tilt": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.resized),
        limits.always,
        limits.between(Range(0.0, STATE_LIMIT)),
    ),
    "tilt_direction": Quantity(
        _fixed(1),
        changes.set_tilt_by(changes.redirected),
        limits.always,
        limits.between(ranges.ANGLE),
    ),
    "turn": Quantity(
        _fixed(1),
        changes.set_tilt_by(lambda wz, turn: WZ(wz.w, turn[0])),
        limits.always,
        limits.between(limits.STATE),
    ),
    "attitude_error": Quantity(
        _fixed(3), changes.set_attitude_error, limits.always, limits.between(ranges.ROTATION)
    ),
    "omega": Quantity(_fixed(3), changes.set_omega, limits.always, limits.of_omega),
    "rate_error": Quantity(
        _fixed(2), changes.set_rate_error, limits.needs_reference, limits.between(limits.STATE)
    ),
    **_of_disturbances(),
    **_of_effectors(),
    **{actuator.failed_quantity.name: _of_failed(actuator) for actuator in ACTUATORS},
}

_ORDER = tuple(DISPERSIBLE)

QUANTITIES = dict(sorted(_QUANTITIES.items(), key=lambda item: _ORDER.index(item[0])))
"""By name, in the order in which they are applied."""
