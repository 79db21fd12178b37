"""Which numbers may be drawn for a quantity: those that leave the model in its ranges.

Ranges are those of `jaxsat.core.ranges`, which the keys of a scenario have as well; a quantity that
changes a nominal number turns them into limits of the change.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

import jaxsat.core.ranges as ranges
from jaxsat.core.checks import as_float, concrete, numpy_if_known
from jaxsat.core.ranges import STATE_LIMIT, Range
from jaxsat.simulation import AbstractLoop, SampledLoop
from jaxsat.simulation.parts import failures_of, parts_of
from jaxsat.spacecraft import (
    AbstractEffector,
    AbstractFailures,
    Actuators,
    FailureKind,
    GimbalFailureKind,
    GimbalFailures,
    MagnetorquerFailures,
    Spacecraft,
    WheelFailureKind,
    WheelFailures,
    Wheels,
)
from jaxsat.spacecraft.environment import AbstractOrbit, ConstantTorque, PeriodicTorque
from jaxsat.studies.part_changes import (
    navigation_of,
    thruster_count,
    thrusters_of,
)
from jaxsat.studies.perturbed import controller_of, effector_of


class Limits(NamedTuple):
    """Least and largest number of a draw, for all components or for each."""

    low: Float[Array | np.ndarray, "*n"]
    high: Float[Array | np.ndarray, "*n"]


STATE = Range(-STATE_LIMIT, STATE_LIMIT)
"""Rates (rad/s) and angles (rad) with which a run goes on."""


def between(values: Range) -> Callable[[AbstractLoop], Limits]:
    """Of numbers that are drawn as they are."""
    return lambda loop: Limits(as_float(values.low), as_float(values.high))


def changing(
    values: Range, nominal: Callable[[AbstractLoop], Float[Array, " n"]]
) -> Callable[[AbstractLoop], Limits]:
    """Of relative changes of what `nominal` finds in a loop."""
    return lambda loop: limits_of_change(values, nominal(loop))


def limits_of_change(values: Range, nominal: Float[Array, " n"]) -> Limits:
    """Relative changes that keep nominal numbers in their range; zero remains zero whatever it is
    multiplied with."""
    xp, numbers = numpy_if_known(nominal)
    safe = xp.where(numbers == 0, 1.0, numbers)
    one, other = values.low / safe, values.high / safe
    free = xp.where(numbers == 0, xp.inf, 0.0)
    return Limits(xp.minimum(one, other) - 1 - free, xp.maximum(one, other) - 1 + free)


def of_products(loop: AbstractLoop) -> Limits:
    """Jij² < Ji Jj, else some axis has a negative moment; what else must hold the draw tells."""
    xp, inertia, moments = numpy_if_known(loop.plant.spacecraft.inertia, moments_of(loop))
    first, second = np.array([0, 0, 1]), np.array([1, 2, 2])
    widest = xp.sqrt(moments[first] * moments[second])
    least, there = xp.min(moments), inertia[first, second]
    return Limits((-widest - there) / least, (widest - there) / least)


def of_constant_torque(loop: AbstractLoop) -> Limits:
    """Beside the constant torque that there is."""
    terms = [term.torque for term in parts_of(ConstantTorque, loop.plant.disturbance)]
    there = sum(terms, as_float(np.zeros(3)))
    return Limits(ranges.TORQUE.low - there, ranges.TORQUE.high - there)


def of_delay(loop: AbstractLoop) -> Limits:
    """At most the period of the controller."""
    period = cast(SampledLoop, loop).controller.period
    return Limits(jnp.zeros_like(period), period)


def of_update_period(loop: AbstractLoop) -> Limits:
    """From one period of the controller on."""
    period = cast(SampledLoop, loop).controller.period
    return Limits(period, jnp.full_like(period, ranges.SECONDS.high))


def of_latency(loop: AbstractLoop) -> Limits:
    """At most as long as measurements are kept: the nominal latency, but for rounding."""
    period = cast(SampledLoop, loop).controller.period
    most = navigation_of(loop).tracker.latency + 1e-9
    return Limits(jnp.zeros_like(period), period * most)


def of_omega(loop: AbstractLoop) -> Limits:
    """A held third rate begins at zero, and stays there."""
    third = 0.0 if loop.plant.third_rate_held else STATE_LIMIT
    largest = as_float([STATE_LIMIT, STATE_LIMIT, third])
    return Limits(-largest, largest)


def of_wheel_momentum(loop: AbstractLoop) -> Limits:
    """Up to the limit of each wheel that has one."""
    limit = effector_of(loop, Wheels).momentum_limit
    largest = as_float(ranges.TORQUE.high) if limit is None else limit
    largest = jnp.minimum(largest, ranges.TORQUE.high)
    return Limits(-largest, largest)


def of_failed_thruster(loop: AbstractLoop) -> Limits:
    """Numbers that are rounded to those of the thrusters."""
    (thrusters,) = thrusters_of(loop)
    return Limits(as_float(-0.5), as_float(thruster_count(thrusters) - 0.5))


def of_failed(kind: type[AbstractEffector]) -> Callable[[AbstractLoop], Limits]:
    """Numbers that are rounded to those of the devices of an effector."""
    return lambda loop: Limits(as_float(-0.5), as_float(effector_of(loop, kind).count - 0.5))


def of_failure_kind(loop: AbstractLoop) -> Limits:
    """Numbers that are rounded to kinds.

    None turns a thruster, which takes a vector. An ideal one or a magnetorquer is dead, weak or,
    where it has a limit, stuck; a wheel runs away only where all have a torque limit, and has
    Coulomb friction, whose kind is before that, only under a sampled law.
    """
    thrusters, wheels = thrusters_of(loop), loop.plant.find(Wheels)

    def last(failures: AbstractFailures) -> np.ndarray:
        if isinstance(failures, WheelFailures):
            limited = _is_finite(cast(Wheels, wheels).torque_limit)
            kind = WheelFailureKind.RUNAWAY if limited else WheelFailureKind.FRICTION_TO
            kind = kind if isinstance(loop, SampledLoop) else WheelFailureKind.FRICTION_BY
        elif isinstance(failures, GimbalFailures):
            kind = GimbalFailureKind.RUN_DOWN
        elif isinstance(failures, MagnetorquerFailures):
            kind = FailureKind.STUCK_AT
        elif isinstance(thrusters[0], Actuators):
            kind = FailureKind.STUCK_AT if _is_finite(thrusters[0].limit) else FailureKind.DEGRADED
        else:
            kind = FailureKind.INTERMITTENT
        return np.full(failures.count, kind + 0.5)

    return Limits(as_float(-0.5), _of_failures(loop, last))


def _is_finite(limit: Array | None) -> bool:
    known = None if limit is None else concrete(limit)
    return known is not None and bool(np.all(np.isfinite(known)))


def of_failure_amount(loop: AbstractLoop) -> Limits:
    """Fractions up to 1, as much friction as a wheel may have, and times of any length."""

    def most(failures: AbstractFailures) -> np.ndarray:
        if isinstance(failures, GimbalFailures):
            return np.full(failures.count, ranges.SECONDS.high)
        kinds = concrete(failures.kind)
        friction = (WheelFailureKind.FRICTION_BY, WheelFailureKind.FRICTION_TO)
        if not isinstance(failures, WheelFailures) or kinds is None:
            return np.ones(failures.count)
        return np.where(np.isin(np.rint(kinds), friction), ranges.FRICTION.high, 1.0)

    return Limits(as_float(0.0), _of_failures(loop, most))


def _of_failures(loop: AbstractLoop, each: Callable[[Any], np.ndarray]) -> Float[Array, "*n"]:
    """Numbers of all failures, one where they are the same for all."""
    values = np.concatenate([each(one) for one in failures_of(loop)])
    return as_float(values[0] if np.all(values == values[0]) else values)


def moments_of(loop: AbstractLoop) -> Float[Array, "3"]:
    """J1, J2, J3 of the plant, kg m²."""
    return loop.plant.spacecraft.moments


def rotors_of(loop: AbstractLoop) -> Float[Array, " wheels"]:
    """The inertia of each rotor, kg m²."""
    inertia = effector_of(loop, Wheels).rotor_inertia
    assert inertia is not None
    return inertia


def periodic_of(loop: AbstractLoop) -> PeriodicTorque:
    """The plant's one periodic torque."""
    (torque,) = parts_of(PeriodicTorque, loop.plant.disturbance)
    return torque


def believed_moments(loop: AbstractLoop) -> Float[Array, "3"]:
    """J1, J2, J3 that the controller believes, kg m²."""
    return parts_of(Spacecraft, controller_of(loop))[0].moments


def believed_orbit_rate(loop: AbstractLoop) -> Float[Array, "1"]:
    """ω0 that the controller believes, rad/s."""
    return parts_of(AbstractOrbit, controller_of(loop))[0].rate[None]
