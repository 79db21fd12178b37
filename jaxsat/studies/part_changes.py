"""How dispersed numbers go into actuators, their failures, sensors, estimator and delay."""

import dataclasses
from collections.abc import Callable
from typing import Any, cast

import jax.numpy as jnp
import numpy as np

from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.declaration.keys import DispersibleQuantity
from jaxsat.simulation.loops import AbstractLoop, failures_of, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dispersible import Dispersible
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.thrusters import ThrusterSet
from jaxsat.studies.changes import (
    PerturbedLoop,
    Values,
    in_loop,
    map_parts,
)


def thrusters_of(loop: AbstractLoop) -> list[Actuators | ThrusterSet]:
    """All sets of thrusters that the loop has."""
    effectors = loop.plant.effectors
    return [*parts_of(Actuators, effectors), *parts_of(ThrusterSet, effectors)]


def set_misalignment(perturbed: PerturbedLoop, angles: Values) -> PerturbedLoop:
    """The case with torque axes turned; the command is shared as in the nominal loop."""
    return _with_thrusters(perturbed, lambda one: one.misaligned(angles.reshape(one.count, 2)))


def set_torque_gain(perturbed: PerturbedLoop, change: Values) -> PerturbedLoop:
    """The case with torques made larger by relative changes."""
    return _with_thrusters(perturbed, lambda one: one.stronger(change))


def _with_thrusters(
    perturbed: PerturbedLoop,
    change: Callable[[Actuators | ThrusterSet], Actuators | ThrusterSet],
) -> PerturbedLoop:
    kinds = (Actuators, ThrusterSet)

    def changed(part):
        return change(part) if isinstance(part, kinds) else part

    effectors = map_parts(changed, kinds, perturbed.loop.plant.effectors)
    return in_loop(perturbed, lambda loop: loop.plant.effectors, effectors)


def set_field(part_of: Callable[[AbstractLoop], Any], quantity: DispersibleQuantity):
    """Gives the function that sets a field of a part; the law believes the nominal numbers."""

    def where(loop: AbstractLoop) -> Any:
        return getattr(part_of(loop), quantity.field or "")

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        old = where(perturbed.loop)
        new = old * (1 + values) if quantity.relative else values
        return in_loop(perturbed, where, new if old is not None and old.ndim else new[0])

    return apply


def set_in_effector(kind: type[AbstractEffector], one: Dispersible):
    """Gives the function that changes an effector, or its state at the start."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        plant = perturbed.loop.plant
        states = list(plant.complete(perturbed.start).of_each)
        place = next(n for n, other in enumerate(plant.effectors) if isinstance(other, kind))
        effector, state = one.changed(plant.effectors[place], states[place], values)
        if effector is not plant.effectors[place]:
            perturbed = in_loop(perturbed, lambda loop: loop.plant.effectors[place], effector)
        if state is not states[place]:
            states[place] = state
            start = dataclasses.replace(perturbed.start, effectors=tuple(states))
            perturbed = perturbed._replace(start=start)
        return perturbed

    return apply


def set_failure(field: str, part: str | None = None):
    """Gives the function that sets a field of all failures, or of those of one kind of actuator."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        def fields(loop: AbstractLoop) -> list:
            return [getattr(one, field) for one in failures_of(loop) if part in (None, one.part)]

        ends = np.cumsum([one.size for one in fields(perturbed.loop)])[:-1]
        return in_loop(perturbed, fields, jnp.split(values, ends))

    return apply


def navigation_of(loop: AbstractLoop) -> Navigation:
    """Sensors with a state and their estimator, which `obstacle` has made sure of."""
    return cast(Navigation, cast(SampledLoop, loop).navigation)


def set_tracker_samples(field: str, least: int):
    """Gives the function that sets a time (s) of the star tracker, not that of its estimator.

    The estimator believes the nominal time. The new one is rounded to whole periods of the law, and
    is at least `least` of them.
    """

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        samples = jnp.round(values[0] / cast(SampledLoop, perturbed.loop).controller.period)
        return in_loop(
            perturbed,
            lambda loop: getattr(loop.navigation.tracker, field),
            jnp.maximum(samples, least).astype(int),
        )

    return apply


def set_delay(perturbed: PerturbedLoop, delay: Values) -> PerturbedLoop:
    """The case with another computing delay, s."""
    return in_loop(perturbed, lambda loop: loop.delay, delay[0])
