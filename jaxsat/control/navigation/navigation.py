"""Sensors with a state of their own and the estimator behind them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree, UInt32

from jaxsat.control.navigation.estimator import (
    AbstractEstimator,
    Estimate,
    Measurement,
    rotation_vector,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.sensors import as_key, in_parameters_of


class Delivery(NamedTuple):
    """An attitude of the star tracker (unit quaternion, scalar first), and whether there is one."""

    attitude: Float[Array, "*latency 4"]
    seen: Bool[Array, "*latency"]


class NavigationState(NamedTuple):
    """The gyro's bias (rad/s), what the star tracker has yet to deliver, the estimator's memory.

    Of what is to be delivered the oldest stands first; None is a tracker without latency. `rate` is
    the last valid measurement of the gyro (rad/s), None where all are valid.
    """

    bias: Vector
    waiting: Delivery | None
    memory: PyTree
    rate: Vector | None = None


class Told(NamedTuple):
    """What a law is told at one sample; with sensors and estimator that have a state, the next one.

    `errors` are those of the estimate by the names of signals: truth less estimate, and three of
    the deviations claimed, of what is estimated. `valid` is whether the law may use it, None where
    it always may.
    """

    state: PlantState
    navigation: NavigationState | None = None
    errors: Mapping[str, Vector] = MappingProxyType({})
    valid: BoolScalar | None = None


class Navigation(eqx.Module):
    """Gyro, star tracker and estimator between the true state and a sampled law.

    `attitude_sigma` (rad) is the standard deviation of the first estimate about each axis. All that
    is random is a function of `key` (two 32-bit words) and of the sample's number.
    """

    gyro: Gyro
    tracker: StarTracker
    estimator: AbstractEstimator
    attitude_sigma: RealScalar = eqx.field(converter=as_float, default=0.0)
    key: UInt32[Array, "2"] = eqx.field(converter=as_key, default=(0, 0))

    def __check_init__(self):
        require_positive("attitude_sigma", self.attitude_sigma, zero_allowed=True)

    def init(self, state: PlantState) -> NavigationState:
        """The state before the first sample, when the truth is `state`: bias and estimate drawn."""
        own = fold_in(self.key, name_number("start of navigation"))
        noise = sample_noise(own, jnp.array(0), 6, state.omega.dtype)
        sigma, true = self.attitude_sigma, state.attitude.as_quaternion()
        memory = self.estimator.init(true.turned(sigma * noise[3:]), sigma)
        count, waiting = self.tracker.latency, None
        if count:
            waiting = Delivery(jnp.stack([true.q] * count), jnp.zeros(count, bool))
        rate = None if self.gyro.outage is None else jnp.zeros_like(state.omega)
        return NavigationState(self.gyro.first_bias(noise[:3]), waiting, memory, rate)

    def step(
        self, sample: IntScalar, period: RealScalar, plant: PlantState, state: NavigationState
    ) -> tuple[Estimate, NavigationState]:
        """The estimate at a sample of the run when the truth is `plant`, and the next state.

        Samples are `period` s apart. In place of an invalid rate, the estimator is told the last
        valid one.
        """
        noise = sample_noise(self.key, sample, 9, plant.omega.dtype)
        rate = self.gyro.measured(plant.omega, state.bias, noise[:3], period)
        valid = self.gyro.is_valid(sample, period)
        if valid is not None and state.rate is not None:
            rate = jnp.where(valid, rate, state.rate)
        attitude = self.tracker.measured(plant.attitude.as_quaternion(), noise[6:])
        arriving = Delivery(attitude.q, self.tracker.measures(sample, period, plant.omega))
        waiting = state.waiting
        if waiting is not None:
            queue = jax.tree.map(
                lambda old, new: jnp.concatenate([old, new[None]]), waiting, arriving
            )
            arriving = self.tracker.arriving(queue)
            waiting = Delivery(*(part[1:] for part in queue))
        measurement = Measurement(rate, Quaternion(arriving.attitude), arriving.seen)
        estimate, memory = self.estimator.step(sample, period, measurement, state.memory)
        bias = self.gyro.next_bias(state.bias, noise[3:6], period)
        last = None if state.rate is None else rate
        return estimate, NavigationState(bias, waiting, memory, last)

    def told(
        self, sample: IntScalar, period: RealScalar, plant: PlantState, state: NavigationState
    ) -> Told:
        """What the law is told, the attitude in the parameters of the true one; as `step`."""
        estimate, following = self.step(sample, period, plant, state)
        attitude = in_parameters_of(plant.attitude, estimate.attitude)
        errors = _errors(plant, state.bias, estimate)
        estimated = PlantState(attitude, estimate.omega, plant.effectors)
        return Told(estimated, following, errors, self.gyro.is_valid(sample, period))


def _errors(plant: PlantState, bias: Vector, estimate: Estimate) -> dict[str, Vector]:
    off = {
        "attitude": rotation_vector(estimate.attitude, plant.attitude.as_quaternion()),
        "rate": plant.omega - estimate.omega,
        "bias": None if estimate.bias is None else bias - estimate.bias,
    }
    claimed = {
        "attitude": estimate.attitude_sigma,
        "rate": estimate.rate_sigma,
        "bias": estimate.bias_sigma,
    }
    errors = {f"{name}_estimate_error": one for name, one in off.items() if one is not None}
    bounds = {f"{n}_estimate_3sigma": 3 * one for n, one in claimed.items() if one is not None}
    return errors | bounds
