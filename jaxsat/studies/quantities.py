"""Sizes of the dispersible quantities and their places in the model.

Defined here are quantities of sensors, disturbances, effectors, their failures and the delay; the
others are in `model_quantities.py`.
"""

import dataclasses
import pkgutil
from collections.abc import Callable
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core import ranges
from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.actuators import ACTUATORS, PARTS
from jaxsat.core.declaration.disturbances import DISTURBANCES
from jaxsat.core.declaration.keys import DispersibleQuantity
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.sensors import SAMPLING, SENSED
from jaxsat.simulation.loops import AbstractLoop, failures_of, parts_of, sensor_failures_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dispersible import Dispersible, Limits
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.spacecraft.sensor_failures import AbstractSensorFailures
from jaxsat.studies.changes import (
    Obstacle,
    PerturbedLoop,
    Quantity,
    Values,
    between,
    changing,
    in_loop,
    needs_torque_level,
)
from jaxsat.studies.model_quantities import MODEL_QUANTITIES


def _of_field(
    one: DispersibleQuantity,
    part_of: Callable[[AbstractLoop], Any],
    obstacle: Obstacle,
    lacks: str = "",
) -> Quantity:
    """Quantity that is one field of a part; `lacks` begins the message if the field is None.

    The law's model keeps the nominal numbers.
    """
    field, within = one.field, one.within
    assert field is not None
    assert within is not None

    def where(loop: AbstractLoop) -> Any:
        return getattr(part_of(loop), field)

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        old = where(perturbed.loop)
        new = old * (1 + values) if one.relative else values
        return in_loop(perturbed, where, new if old is not None and old.ndim else new[0])

    def needs_number(loop: AbstractLoop) -> str | None:
        missing = f"{lacks} {field.replace('_', ' ')}"
        return obstacle(loop) or (missing if where(loop) is None else None)

    limits = changing(within, where) if one.relative else between(within)
    return Quantity(apply, limits, lambda loop: np.size(where(loop)), needs_number)


def _of_sensor(name: str, what: str, one: DispersibleQuantity) -> Quantity:
    """Quantity that is a field of the sensor with this name, or of the noise in `[sampling]`."""

    def sensor(loop: AbstractLoop) -> Any:
        if name == SAMPLING:
            return getattr(loop, "sensors", None)
        navigation = getattr(loop, "navigation", None)
        return None if navigation is None else navigation.sensors.get(name)

    def obstacle(loop: AbstractLoop) -> str | None:
        if not isinstance(loop, SampledLoop):
            return "only sampled loops have sensors"
        return None if sensor(loop) is not None else f"the loop has no {what}"

    return _of_field(one, sensor, obstacle, f"the {what} has no")


def _of_disturbance(kind: type, what: str, one: DispersibleQuantity) -> Quantity:
    """Quantity that is a field of the plant's only disturbance of a class."""

    def obstacle(loop: AbstractLoop) -> str | None:
        count = len(parts_of(kind, loop.plant.disturbance))
        return None if count == 1 else f"the plant has {what} {count} times, not once"

    return _of_field(one, lambda loop: parts_of(kind, loop.plant.disturbance)[0], obstacle)


def _of_effector(kind: str, one: DispersibleQuantity) -> Quantity:
    """Quantity of the effector of a kind: a field, or a change by its `Dispersible`."""

    def place(loop: AbstractLoop) -> int | None:
        numbers = (
            number
            for number, other in enumerate(loop.plant.effectors)
            if other.kind == kind and (one.field or one.name in other.dispersible)
        )
        return next(numbers, None)

    def effector(loop: AbstractLoop) -> AbstractEffector:
        return loop.plant.effectors[cast(int, place(loop))]

    def obstacle(loop: AbstractLoop) -> str | None:
        lacks = None if place(loop) is not None else f"the spacecraft has no {kind}s"
        return needs_torque_level(loop) or lacks

    if one.field is not None:
        return _of_field(one, effector, obstacle, f"no {kind} has a")

    def dispersible(loop: AbstractLoop) -> Dispersible:
        return effector(loop).dispersible[one.name]

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        plant, number = perturbed.loop.plant, cast(int, place(perturbed.loop))
        states = list(plant.complete(perturbed.start).of_each)
        before = plant.effectors[number]
        changed, state = dispersible(perturbed.loop).changed(before, states[number], values)
        if changed is not before:
            perturbed = in_loop(perturbed, effector, changed)
        if state is not states[number]:
            states[number] = state
            start = dataclasses.replace(perturbed.start, effectors=tuple(states))
            perturbed = perturbed._replace(start=start)
        return perturbed

    return Quantity(
        apply,
        lambda loop: dispersible(loop).limits(effector(loop)),
        lambda loop: dispersible(loop).size(effector(loop)),
        obstacle,
    )


def _sensor_times(loop: AbstractLoop) -> Limits:
    """The times at which all failing sensors of a loop may fail."""
    every = cast(list[AbstractSensorFailures], sensor_failures_of(loop))
    earliest = max((one.times for one in every), key=lambda one: one.low, default=ranges.FROM_ZERO)
    return Limits.between(earliest)


def _of_failures(
    field: str,
    limits: Callable[[AbstractLoop], Limits],
    part: str | None = None,
    every: Callable[[AbstractLoop], list[AbstractFailures]] = failures_of,
) -> Quantity:
    """Quantity that is a field of `every` failure, or of one kind of part: one number for each."""

    def failures(loop: AbstractLoop) -> list[AbstractFailures]:
        return [one for one in every(loop) if part in (None, one.part)]

    def fields(loop: AbstractLoop) -> list:
        return [getattr(one, field) for one in failures(loop)]

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        ends = np.cumsum([one.size for one in fields(perturbed.loop)])[:-1]
        return in_loop(perturbed, fields, jnp.split(values, ends))

    def obstacle(loop: AbstractLoop) -> str | None:
        which = " of an actuator" if part is None else f" of a {part}"
        return None if failures(loop) else f"the scenario has no failure{which} in flight"

    return Quantity(apply, limits, lambda loop: sum(one.count for one in failures(loop)), obstacle)


def _of_failed(name: str) -> Quantity:
    """Number of the failing device of an actuator."""

    def limits(loop: AbstractLoop) -> Limits:
        (devices,) = [one for one in loop.plant.effectors if one.kind == name]
        return Limits(as_float(-0.5), as_float(devices.count - 0.5))

    return _of_failures("number", limits, name)


def _kind_limits(loop: AbstractLoop) -> Limits:
    """Limits of numbers that are rounded to the kinds that actuators declare as drawn."""
    sampled, effectors = isinstance(loop, SampledLoop), loop.plant.effectors

    def last(failures: AbstractFailures) -> np.ndarray:
        owner = next(one for one in effectors if one.kind == failures.part)
        own, last_declared = owner.last_drawn_kind(sampled), _DRAWN[failures.part][-1]
        return np.full(failures.count, (last_declared if own is None else own) + 0.5)

    return Limits(as_float(-0.5), _of_all_failures(loop, last))


_DRAWN = {one.name: one.drawn for one in ACTUATORS}


def _amount_limits(loop: AbstractLoop) -> Limits:
    return Limits(as_float(0.0), _of_all_failures(loop, lambda one: one.largest_amount()))


def _of_all_failures(loop: AbstractLoop, each: Callable[[Any], np.ndarray]) -> Float[Array, "*n"]:
    """Numbers of all failures, reduced to one if they are equal."""
    values = np.concatenate([each(one) for one in failures_of(loop)])
    return as_float(values[0] if np.all(values == values[0]) else values)


def _period(loop: AbstractLoop) -> RealScalar:
    return cast(SampledLoop, loop).controller.period


def _of_tracker(
    field: str, least: int, limits: Callable[[AbstractLoop], Limits], obstacle: Obstacle
) -> Quantity:
    """Time (s) of the star tracker; the estimator assumes the nominal one.

    The time is rounded to whole periods of the law, and is at least `least` of them.
    """

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        samples = jnp.round(values[0] / _period(perturbed.loop))
        new = jnp.maximum(samples, least).astype(int)
        return in_loop(perturbed, lambda loop: getattr(_tracker_of(loop), field), new)

    return Quantity(apply, limits, obstacle=obstacle)


def _update_period_limits(loop: AbstractLoop) -> Limits:
    period = _period(loop)
    return Limits(period, jnp.full_like(period, ranges.SECONDS.high))


def _tracker_of(loop: AbstractLoop) -> Any:
    navigation = getattr(loop, "navigation", None)
    return None if navigation is None else navigation.tracker


def _latency_limits(loop: AbstractLoop) -> Limits:
    """Limits up to the nominal latency, for which measurements are buffered."""
    period, most = _period(loop), _tracker_of(loop).latency + 1e-9
    return Limits(jnp.zeros_like(period), period * most)


def _needs_tracker(loop: AbstractLoop) -> str | None:
    return None if _tracker_of(loop) is not None else "the loop has no star tracker"


def _needs_latency(loop: AbstractLoop) -> str | None:
    no_latency = _needs_tracker(loop) is None and not _tracker_of(loop).latency
    return "the star tracker has no latency" if no_latency else _needs_tracker(loop)


def _needs_delay(loop: AbstractLoop) -> str | None:
    return None if getattr(loop, "delay", None) is not None else "the loop has no delay"


_QUANTITIES: dict[str, Quantity] = {
    **MODEL_QUANTITIES,
    **{
        one.name: _of_sensor(name, sensor.summary, one)
        for name, sensor in SENSED.items()
        for one in sensor.quantities
        if one.field is not None
    },
    "tracker_update_period": _of_tracker("every", 1, _update_period_limits, _needs_tracker),
    "tracker_latency": _of_tracker("arrival", 0, _latency_limits, _needs_latency),
    "failure_time": _of_failures("at", between(ranges.FROM_ZERO)),
    "sensor_failure_time": _of_failures("at", _sensor_times, "sensor", sensor_failures_of),
    "failure_kind": _of_failures("kind", _kind_limits),
    "failure_amount": _of_failures("amount", _amount_limits),
    "delay": Quantity(
        lambda perturbed, delay: in_loop(perturbed, lambda loop: loop.delay, delay[0]),
        lambda loop: Limits(jnp.zeros_like(_period(loop)), _period(loop)),
        obstacle=_needs_delay,
    ),
    **{
        one.name: _of_disturbance(pkgutil.resolve_name(place), part.summary, one)
        for place, part in DISTURBANCES.items()
        for one in part.quantities
        if one.field is not None
    },
    **{one.name: _of_effector(part.name, one) for part in PARTS for one in part.dispersible},
    **{one.failed_quantity.name: _of_failed(one.name) for one in ACTUATORS},
}

QUANTITIES = {name: _QUANTITIES[name] for name in DISPERSIBLE}
"""Quantities by name, in the order in which they are applied."""
