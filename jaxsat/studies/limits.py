"""Which numbers may be drawn for a quantity: those that leave the model in its ranges; and why a
loop has no such quantity, as a clause.

Ranges are those of `jaxsat.core.ranges`, which the keys of a scenario have as well; a quantity that
changes a nominal number turns them into limits of the change.
"""

from collections.abc import Callable
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

import jaxsat.core.ranges as ranges
from jaxsat.control.controller import AbstractBacksteppingLaw
from jaxsat.core.array_types import Vector
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.ranges import STATE_LIMIT, Range
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, failures_of, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dispersible import Limits
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.environment.disturbances import ConstantTorque, PeriodicTorque
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.studies.changes import controller_of
from jaxsat.studies.part_changes import navigation_of, thrusters_of

STATE = Range(-STATE_LIMIT, STATE_LIMIT)
"""Rates (rad/s) and angles (rad) with which a run goes on."""


def between(values: Range) -> Callable[[AbstractLoop], Limits]:
    """Limits of numbers that are drawn as they are."""
    return lambda loop: Limits.between(values)


def changing(
    values: Range, nominal: Callable[[AbstractLoop], Float[Array, " n"]]
) -> Callable[[AbstractLoop], Limits]:
    """Limits of relative changes of what `nominal` finds in a loop."""
    return lambda loop: Limits.of_change(values, nominal(loop))


def of_products(loop: AbstractLoop) -> Limits:
    """Limits of products of inertia: Jij² < Ji Jj, else some axis has a negative moment.

    Whatever else must hold is judged draw by draw.
    """
    xp, inertia, moments = numpy_if_known(loop.plant.spacecraft.inertia, moments_of(loop))
    first, second = np.array([0, 0, 1]), np.array([1, 2, 2])
    widest = xp.sqrt(moments[first] * moments[second])
    least, there = xp.min(moments), inertia[first, second]
    return Limits((-widest - there) / least, (widest - there) / least)


def of_constant_torque(loop: AbstractLoop) -> Limits:
    """Limits of a constant torque beside the one that there is."""
    terms = [term.torque for term in parts_of(ConstantTorque, loop.plant.disturbance)]
    there = sum(terms, as_float(np.zeros(3)))
    return Limits(ranges.TORQUE.low - there, ranges.TORQUE.high - there)


def of_delay(loop: AbstractLoop) -> Limits:
    """Limits of a delay: at most the period of the controller."""
    period = cast(SampledLoop, loop).controller.period
    return Limits(jnp.zeros_like(period), period)


def of_update_period(loop: AbstractLoop) -> Limits:
    """Limits of a tracker's update period: from one period of the controller on."""
    period = cast(SampledLoop, loop).controller.period
    return Limits(period, jnp.full_like(period, ranges.SECONDS.high))


def of_latency(loop: AbstractLoop) -> Limits:
    """Limits of a latency: at most the nominal one, for which measurements are kept."""
    period = cast(SampledLoop, loop).controller.period
    most = navigation_of(loop).tracker.latency + 1e-9
    return Limits(jnp.zeros_like(period), period * most)


def of_omega(loop: AbstractLoop) -> Limits:
    """Limits of rates at the start; a held third rate begins at zero, and stays there."""
    third = 0.0 if loop.plant.third_rate_held else STATE_LIMIT
    largest = np.array([STATE_LIMIT, STATE_LIMIT, third])
    return Limits(as_float(-largest), as_float(largest))


def of_failed(actuator: ActuatorDeclaration) -> Callable[[AbstractLoop], Limits]:
    """Limits of numbers that are rounded to those of the devices of an actuator."""

    def limits(loop: AbstractLoop) -> Limits:
        (devices,) = [one for one in loop.plant.effectors if one.kind == actuator.name]
        return Limits(as_float(-0.5), as_float(devices.count - 0.5))

    return limits


def of_failure_kind(loop: AbstractLoop) -> Limits:
    """Limits of numbers that are rounded to kinds: those that actuators declare as drawn."""
    sampled, effectors = isinstance(loop, SampledLoop), loop.plant.effectors

    def last(failures: AbstractFailures) -> np.ndarray:
        owner = next(one for one in effectors if one.kind == failures.part)
        own, last_declared = owner.last_drawn_kind(sampled), _DRAWN[failures.part][-1]
        return np.full(failures.count, (last_declared if own is None else own) + 0.5)

    return Limits(as_float(-0.5), _of_failures(loop, last))


_DRAWN = {one.name: one.drawn for one in ACTUATORS}


def of_failure_amount(loop: AbstractLoop) -> Limits:
    """Limits of amounts: from nothing to the most of each failure."""
    return Limits(as_float(0.0), _of_failures(loop, lambda failures: failures.largest_amount()))


def _of_failures(loop: AbstractLoop, each: Callable[[Any], np.ndarray]) -> Float[Array, "*n"]:
    """Numbers of all failures, one where they are the same for all."""
    values = np.concatenate([each(one) for one in failures_of(loop)])
    return as_float(values[0] if np.all(values == values[0]) else values)


def moments_of(loop: AbstractLoop) -> Vector:
    """J1, J2, J3 of the plant, kg m²."""
    return loop.plant.spacecraft.moments


def periodic_of(loop: AbstractLoop) -> PeriodicTorque:
    """The plant's one periodic torque."""
    (torque,) = parts_of(PeriodicTorque, loop.plant.disturbance)
    return torque


def believed_moments(loop: AbstractLoop) -> Vector:
    """J1, J2, J3 that the controller believes, kg m²."""
    return parts_of(Spacecraft, controller_of(loop))[0].moments


def believed_orbit_rate(loop: AbstractLoop) -> Float[Array, "1"]:
    """ω0 that the controller believes, rad/s."""
    return parts_of(AbstractOrbit, controller_of(loop))[0].rate[None]


def always(loop: AbstractLoop) -> None:
    """None: every loop has such a quantity."""


def needs_torque_level(loop: AbstractLoop) -> str | None:
    """The obstacle unless torques reach the plant through actuators."""
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


def needs_model(kind: type) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the controller believes a model with such a part."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if not parts_of(kind, controller_of(loop)):
            return "the controller has no model of the plant"
        return needs_torque_level(loop)

    return obstacle


def needs_sensor(place: str, what: str) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the loop is sampled with a sensor at this attribute."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if not isinstance(loop, SampledLoop):
            return "only sampled loops have sensors"
        part: Any = loop
        for name in place.split("."):
            part = getattr(part, name, None)
        return None if part is not None else f"the loop has no {what}"

    return obstacle


def needs_navigation(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has gyro and star tracker."""
    there = isinstance(loop, SampledLoop) and loop.navigation is not None
    return None if there else "the loop has no gyro and star tracker"


def needs_latency(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has a star tracker with a latency."""
    obstacle = needs_navigation(loop)
    if obstacle is None and not navigation_of(loop).tracker.latency:
        return "the star tracker has no latency"
    return obstacle


def needs_delay(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has a computing delay."""
    delayed = isinstance(loop, SampledLoop) and loop.delay is not None
    return None if delayed else "the loop has no delay"


def needs_reference(loop: AbstractLoop) -> str | None:
    """The obstacle unless the law has a reference rate of its own."""
    law = isinstance(controller_of(loop), AbstractBacksteppingLaw)
    return None if law else "the controller has no reference rate of its own"


def needs_thrusters(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has one set of thrusters."""
    obstacle = needs_torque_level(loop)
    if obstacle is None and len(thrusters_of(loop)) != 1:
        return "the actuators are no thrusters"
    return obstacle


def needs_failures(part: str | None = None) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless an actuator of the kind `part`, or any, fails in flight."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if any(part in (None, one.part) for one in failures_of(loop)):
            return None
        which = "" if part is None else f" of a {part}"
        return f"the scenario has no failure{which} in flight"

    return obstacle


def needs_effector(kind: type[AbstractEffector]) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the spacecraft has an effector of this class."""

    def obstacle(loop: AbstractLoop) -> str | None:
        there = loop.plant.find(kind) is not None
        return None if there else f"the spacecraft has no {kind.kind}s"

    return obstacle


def needs_disturbance(kind: type, what: str) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the plant has one disturbance of this class."""

    def obstacle(loop: AbstractLoop) -> str | None:
        count = len(parts_of(kind, loop.plant.disturbance))
        return None if count == 1 else f"the plant has {what} {count} times, not once"

    return obstacle
