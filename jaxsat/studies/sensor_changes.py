"""How dispersed numbers go into sensors, estimator and computing delay."""

from typing import cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxsat.control.navigation import Navigation
from jaxsat.simulation import AbstractLoop, SampledLoop
from jaxsat.studies.perturbed import PerturbedLoop, Values, in_loop, with_thrusters


def navigation_of(loop: AbstractLoop) -> Navigation:
    """Sensors with a state and their estimator, which `obstacle` has made sure of."""
    return cast(Navigation, cast(SampledLoop, loop).navigation)


def set_sensor(field: str):
    """A change of one field of the sensors."""

    def apply(perturbed: PerturbedLoop, sigma: Values) -> PerturbedLoop:
        return in_loop(perturbed, lambda loop: getattr(loop.sensors, field), sigma[0])

    return apply


def set_gyro(field: str):
    """Another number, or three, in a field of the gyro; the estimator believes the nominal ones."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        old = getattr(navigation_of(perturbed.loop).gyro, field)
        new = values if old.ndim else values[0]
        return in_loop(perturbed, lambda loop: getattr(loop.navigation.gyro, field), new)

    return apply


def set_tracker(field: str):
    """Another number in a field of the star tracker; the estimator believes the nominal one."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        return _in_tracker(perturbed, field, values[0])

    return apply


def set_tracker_samples(field: str, least: int):
    """The same of a time (s) that counts whole periods of the law, at least so many."""

    def apply(perturbed: PerturbedLoop, values: Values) -> PerturbedLoop:
        loop = with_thrusters(perturbed.loop)
        samples = jnp.round(values[0] / cast(SampledLoop, loop).controller.period)
        return _in_tracker(perturbed, field, jnp.maximum(samples, least).astype(int))

    return apply


def _in_tracker(perturbed: PerturbedLoop, field: str, new: Array) -> PerturbedLoop:
    loop = eqx.tree_at(
        lambda loop: getattr(loop.navigation.tracker, field),
        perturbed.loop,
        new,
        is_leaf=lambda part: part is None,
    )
    return perturbed._replace(loop=loop)


def set_delay(perturbed: PerturbedLoop, delay: Values) -> PerturbedLoop:
    """Another computing delay, s."""
    return in_loop(perturbed, lambda loop: loop.delay, delay[0])
