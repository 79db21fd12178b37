"""Navigation: sensors with a state, and their estimator."""

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
    latency_of,
    rotation_vector,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float, not_negative
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.sensor_failures import SensorCondition, SensorFailures, SensorReading
from jaxsat.spacecraft.sensors import as_key, in_parameters_of
from jaxsat.spacecraft.spacecraft import OfEach
from jaxsat.spacecraft.vector_sensors import Observation, VectorSensor


class Delivery(NamedTuple):
    """An attitude of the star tracker (unit quaternion, scalar first), and whether it is present.

    Both are None without a star tracker. `vectors` are the measurements of the vector sensors.
    """

    attitude: Float[Array, "*latency 4"] | None
    seen: Bool[Array, "*latency"] | None
    vectors: tuple[Observation, ...] = ()


class NavigationState(NamedTuple):
    """The gyro's bias (rad/s), undelivered measurements, and the estimator's memory.

    The oldest undelivered one is first; None for sensors without latency. `rate` is the last valid
    reading of the gyro (rad/s), None where all are valid and it does not fail. `last` is the last
    reading of each attitude sensor, None where none fails. Without a gyro `bias` is None. For an
    estimator that knows the body `torque` (N m) is the mean torque commanded since the last sample.
    """

    bias: Vector | None
    waiting: Delivery | None
    memory: PyTree
    rate: Vector | None = None
    last: Delivery | None = None
    torque: Vector | None = None


class LawInput(NamedTuple):
    """Input of a law at a sample; with sensors and estimator that have a state, also the next
    state.

    `errors` of the estimated quantities, by the names of signals, are truth less estimate, and
    three times the computed deviations. `valid` is whether the law may use the input, None for
    always. `momenta` are the last readings of tachometers (N m s), None where none fails.
    """

    state: PlantState
    navigation: NavigationState | None = None
    errors: Mapping[str, Vector] = MappingProxyType({})
    valid: BoolScalar | None = None
    momenta: Float[Array, " wheels"] | None = None


class Navigation(eqx.Module):
    """Gyro, sensors of the attitude and estimator between the true state and a sampled law.

    The measurements of all attitude sensors at a sample are delivered together, when the slowest
    has arrived. At least one is given: the star tracker or one of `vectors`, of different names.
    `attitude_sigma` (rad) is the standard deviation of the first estimate about each axis. All
    randomness is a function of `key` (two 32-bit words) and of the sample's number. `failures`
    number the attitude sensors that are given, in this order. The `body` is given for an estimator
    that predicts rates by the dynamics, and without a gyro: the declared one, whose actuators obey.
    A law may then use the estimate at every sample, also while rates are invalid.
    """

    gyro: Gyro | None
    tracker: StarTracker | None
    estimator: AbstractEstimator
    attitude_sigma: RealScalar = eqx.field(converter=not_negative("attitude_sigma"), default=0.0)
    key: UInt32[Array, "2"] = eqx.field(converter=as_key, default=(0, 0))
    vectors: tuple[VectorSensor, ...] = ()
    failures: SensorFailures | None = None
    body: RigidBody | None = None

    def __check_init__(self):
        if self.gyro is None and self.body is None:
            raise ValueError("Argument `body` must be given without `gyro`.")
        if self.tracker is None and not self.vectors:
            raise ValueError("Argument `tracker` must be given without another such sensor.")

    @property
    def sensors(self) -> dict[str, Gyro | StarTracker | VectorSensor]:
        """Star tracker, sensors of vectors and gyro by the names of their tables."""
        tracker = {} if self.tracker is None else {"star_tracker": self.tracker}
        gyro = {} if self.gyro is None else {"gyro": self.gyro}
        return tracker | {one.key: one for one in self.vectors} | gyro

    def init(self, state: PlantState) -> NavigationState:
        """The state before the first sample, for the true `state`, with drawn bias and estimate."""
        own = fold_in(self.key, name_number("start of navigation"))
        noise = sample_noise(own, jnp.array(0), 6, state.omega.dtype)
        sigma, true = self.attitude_sigma, state.attitude.as_quaternion()
        memory = self.estimator.init(true.turned(sigma * noise[3:]), sigma)
        count, waiting = latency_of(self.tracker, self.vectors), None
        if count:
            waiting = jax.tree.map(lambda part: jnp.stack([part] * count), self._nothing(true))
        last = None if self.failures is None else self._nothing(true)
        zero = jnp.zeros_like(state.omega)
        torque = None if self.body is None else zero
        if self.gyro is None:
            return NavigationState(None, waiting, memory, None, last, torque)
        rate = zero if self.gyro.repeats else None
        return NavigationState(self.gyro.first_bias(noise[:3]), waiting, memory, rate, last, torque)

    def step(
        self, sample: IntScalar, period: RealScalar, plant: PlantState, state: NavigationState
    ) -> tuple[Estimate, NavigationState]:
        """The estimate at a sample of the run for the true state `plant`, and the next state.

        Samples are `period` s apart. An invalid rate is replaced by the last valid one. Momenta of
        wheels are taken as those of `plant`, which are measured ones.
        """
        noise = sample_noise(self.key, sample, 9, plant.omega.dtype)
        rate, bias = self._rate(sample, period, plant, state, noise[:6])
        arriving, waiting = self._measured(sample, period, plant, noise[6:]), state.waiting
        arriving, readings = self._with_failures(sample, period, arriving, state.last)
        if waiting is not None:
            queue = jax.tree.map(
                lambda old, new: jnp.concatenate([old, new[None]]), waiting, arriving
            )
            arriving, waiting = self._arriving(queue), jax.tree.map(lambda part: part[1:], queue)
        q = arriving.attitude
        attitude = None if q is None else Quaternion(q)
        momentum = None if self.body is None else self.stored_momentum(plant)
        valid = None if self.body is None else self._valid(sample, period)
        inputs = (arriving.vectors, state.torque, momentum, valid)
        measurement = Measurement(rate, attitude, arriving.seen, *inputs)
        estimate, memory = self.estimator.step(sample, period, measurement, state.memory)
        last = None if state.rate is None else rate
        return estimate, NavigationState(bias, waiting, memory, last, readings, state.torque)

    def _rate(
        self,
        sample: IntScalar,
        period: RealScalar,
        plant: PlantState,
        state: NavigationState,
        noise: Float[Array, "6"],
    ) -> tuple[Vector | None, Vector | None]:
        """What the gyro reads (rad/s), and its next bias; None without one."""
        gyro, bias = self.gyro, state.bias
        if gyro is None or bias is None:
            return None, None
        rate = gyro.measured(plant.omega, bias, noise[:3], period)
        if state.rate is not None:
            rate = gyro.read(sample, period, rate, state.rate, self.key)
        return rate, gyro.next_bias(bias, noise[3:], period)

    def _valid(self, sample: IntScalar, period: RealScalar) -> BoolScalar | None:
        """Whether the rate of a sample is valid; None for always, and without a gyro."""
        return None if self.gyro is None else self.gyro.is_valid(sample, period)

    def stored_momentum(self, plant: PlantState) -> Vector | None:
        """The momentum of the body's devices that store it, N m s; None without any."""
        effectors = () if self.body is None else self.body.effectors
        parts = [
            momentum
            for one, own in zip(effectors, plant.of_each, strict=True)
            if one.storage() is not None and (momentum := one.momentum(own)) is not None
        ]
        return sum(parts[1:], parts[0]) if parts else None

    def outer_torque(self, t: RealScalar, estimate: PlantState, commands: OfEach) -> Vector:
        """The torque of the body's actuators under these commands at time `t` (s) on the body and
        all that stores momentum, N m, at the attitude that a law receives."""
        effectors = () if self.body is None else self.body.effectors
        torques = [
            one.effect(one.piece(one.mode(own), command), t, estimate, own).torque
            for one, own, command in zip(effectors, estimate.of_each, commands, strict=True)
            if one.momentum(own) is None
        ]
        return sum(torques, jnp.zeros_like(estimate.omega))

    def example(self) -> Measurement:
        """A measurement with the array shapes of this navigation."""
        attitude = Quaternion(as_float([1.0, 0.0, 0.0, 0.0]))
        nothing = self._nothing(attitude)
        attitude_or_none = None if nothing.attitude is None else attitude
        zero, inputs = attitude.q[1:], (attitude_or_none, nothing.seen, nothing.vectors)
        if self.body is None:
            return Measurement(zero, *inputs)
        stores = any(one.storage() is not None for one in self.body.effectors)
        rate = None if self.gyro is None else zero
        return Measurement(rate, *inputs, zero, zero if stores else None)

    def _nothing(self, attitude: Quaternion) -> Delivery:
        """A delivery without measurements, of the usual shapes."""
        unseen, vector = jnp.array(False), jnp.eye(3, dtype=attitude.q.dtype)[0]
        vectors = tuple(Observation(vector, vector, unseen) for _ in self.vectors)
        if self.tracker is None:
            return Delivery(None, None, vectors)
        return Delivery(attitude.q, unseen, vectors)

    def _measured(
        self, sample: IntScalar, period: RealScalar, plant: PlantState, noise: Vector
    ) -> Delivery:
        """The present measurements of the attitude sensors; `noise` is the star tracker's."""
        true = plant.attitude.as_quaternion()
        vectors = tuple(one.observed(sample, period, true, self.key) for one in self.vectors)
        if self.tracker is None:
            return Delivery(None, None, vectors)
        attitude = self.tracker.measured(true, noise)
        return Delivery(attitude.q, self.tracker.measures(sample, period, plant.omega), vectors)

    def _with_failures(
        self, sample: IntScalar, period: RealScalar, new: Delivery, last: Delivery | None
    ) -> tuple[Delivery, Delivery | None]:
        """What the sensors read with their failures in place of `new`, and their last readings."""
        failures = self.failures
        if failures is None or last is None:
            return new, None
        count = len(self.vectors) + (self.tracker is not None)
        conditions = failures.conditions(sample, period, self.key, count)
        readings, last_readings = [], []
        vectors = zip(self.vectors, conditions[count - len(self.vectors) :], strict=True)
        for place, (sensor, condition) in enumerate(vectors):
            now, before = new.vectors[place], last.vectors[place]
            one, other = failures.vector(
                condition,
                SensorReading(now.measured, now.seen),
                SensorReading(before.measured, before.seen),
                sensor.is_due(sample, period),
            )
            readings.append(Observation(one.value, now.reference, one.seen))
            last_readings.append(Observation(other.value, now.reference, other.seen))
        attitude, attitude_kept = self._tracker_reading(sample, period, conditions[0], new, last)
        return Delivery(*attitude, tuple(readings)), Delivery(*attitude_kept, tuple(last_readings))

    def _tracker_reading(
        self,
        sample: IntScalar,
        period: RealScalar,
        condition: SensorCondition,
        new: Delivery,
        last: Delivery,
    ) -> tuple[SensorReading | tuple[None, None], SensorReading | tuple[None, None]]:
        """The star tracker's readings of `_with_failures`; None without one."""
        now, seen, before, had = new.attitude, new.seen, last.attitude, last.seen
        if self.tracker is None or self.failures is None:
            return (None, None), (None, None)
        assert now is not None
        assert seen is not None
        assert before is not None
        assert had is not None
        readings = SensorReading(now, seen), SensorReading(before, had)
        due = self.tracker.is_due(sample, period)
        return self.failures.attitude(condition, *readings, due, period)

    def _arriving(self, queue: Delivery) -> Delivery:
        """The present delivery from the queue of present and earlier measurements."""
        oldest = jax.tree.map(lambda part: part[0], queue)
        if self.tracker is None:
            return oldest
        return self.tracker.arriving(queue)._replace(vectors=oldest.vectors)

    def law_input(
        self, sample: IntScalar, period: RealScalar, plant: PlantState, state: NavigationState
    ) -> LawInput:
        """The law's input, with the attitude in the parameters of the true one; as `step`."""
        estimate, following = self.step(sample, period, plant, state)
        attitude = in_parameters_of(plant.attitude, estimate.attitude)
        errors = _errors(plant, state.bias, estimate)
        estimated = PlantState(attitude, estimate.omega, plant.effectors)
        valid = self._valid(sample, period) if self.body is None else None
        return LawInput(estimated, following, errors, valid)


def _errors(plant: PlantState, bias: Vector | None, estimate: Estimate) -> dict[str, Vector]:
    off = {
        "attitude": rotation_vector(estimate.attitude, plant.attitude.as_quaternion()),
        "rate": plant.omega - estimate.omega,
        "bias": None if bias is None or estimate.bias is None else bias - estimate.bias,
    }
    deviations = {
        "attitude": estimate.attitude_sigma,
        "rate": estimate.rate_sigma,
        "bias": estimate.bias_sigma,
    }
    tests = {"innovation": estimate.innovation, "sensor_excluded": estimate.excluded}
    errors = {f"{name}_estimate_error": one for name, one in off.items() if one is not None}
    bounds = {f"{n}_estimate_3sigma": 3 * one for n, one in deviations.items() if one is not None}
    return errors | bounds | {name: one for name, one in tests.items() if one is not None}
