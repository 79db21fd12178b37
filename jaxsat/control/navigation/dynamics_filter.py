"""A multiplicative extended Kalman filter by the dynamics: attitude error, rate and torque."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.navigation.estimator import Estimate, Measurement, rotation
from jaxsat.control.navigation.innovation import InnovationRecord, InnovationTest
from jaxsat.control.navigation.kalman_filter import AbstractKalmanFilter, corrected, turned
from jaxsat.control.navigation.motion import MotionBelief
from jaxsat.core.array_types import IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion, skew
from jaxsat.core.checks import as_optional_float, not_negative
from jaxsat.core.trees import apart
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.sensor_failures import SensorReading
from jaxsat.spacecraft.spacecraft import inverse_of


class TorqueModel(eqx.Module):
    """What the filter supposes of the torques that nobody commands, the same about each axis.

    They are white noise with the density `noise` (N m/√Hz), and a torque that is fixed in body axes
    but for a random walk with the density `walk` (N m/s/√Hz), which begins with the standard
    deviation `sigma` (N m). Raises `ValueError` for a number below zero.
    """

    noise: RealScalar = eqx.field(converter=not_negative("noise"))
    sigma: RealScalar = eqx.field(converter=not_negative("sigma"), default=0.0)
    walk: RealScalar = eqx.field(converter=not_negative("walk"), default=0.0)


class DynamicsMemory(NamedTuple):
    """The motion at the sample of the latest arrivals, and the inputs since.

    `momenta` (N m s) were measured at the samples, `torques` (N m) commanded in the periods that
    end there. `rates` (rad/s) were measured at the samples, None without a gyro. `record` is that
    of the innovation test, None without one.
    """

    belief: MotionBelief
    momenta: Float[Array, "samples 3"]
    torques: Float[Array, "samples 3"]
    rates: SensorReading | None = None
    record: InnovationRecord | None = None


class DynamicsFilter(AbstractKalmanFilter):
    """A multiplicative extended Kalman filter that predicts the rate by Euler's equation.

    Lefferts, Markley and Shuster (1982) replace the dynamics by a gyro; here they stay. Between
    samples the total momentum H = J ω + h of the `body` moves by the commanded torque of thrusters
    and magnetorquers, the body's modelled disturbance and the estimated torque, while h, that of
    the devices which store momentum, is measured: so the filter needs neither their commands nor
    their friction. `momentum_noise` (N² m² s²) is the covariance of the measured h, None for an
    exact one; its error enters the turns before and after its sample, so that the filter estimates
    it.

    A `gyro` is a sensor as any other: its rate is that of the body, its bias and white noise, and
    its innovation is tested. A reading with an axis at its limit is left out.

    Measurements with latency belong to an earlier sample. The filter stays at that sample and
    predicts from there with the later inputs. `torques` is what it supposes of unknown torques,
    `rate_sigma` (rad/s) the standard deviation of the first rate about each axis; the first
    estimate is that of a body at rest in the orbit frame. Further arguments are those of
    `MultiplicativeFilter`. The disturbance's change with the attitude's error is neglected.
    """

    body: RigidBody
    torques: TorqueModel
    rate_sigma: RealScalar = eqx.field(converter=not_negative("rate_sigma"))
    tracker: StarTracker | None
    vector_noise: tuple[RealScalar, ...] = ()
    vector_latency: int = eqx.field(static=True, default=0)
    test: InnovationTest | None = None
    momentum_noise: Matrix | None = eqx.field(converter=as_optional_float, default=None)
    gyro: Gyro | None = None

    def init(self, attitude: Quaternion, sigma: RealScalar) -> DynamicsMemory:
        """A motion at rest in the orbit frame, without correlations and without a torque."""
        zero = jnp.zeros(3, attitude.q.dtype)
        ones = jnp.ones_like(zero)
        deviations = (sigma, self.rate_sigma, self.torques.sigma)
        variances = jnp.concatenate([deviation**2 * ones for deviation in deviations])
        bias = rates = excess = None
        inputs = jnp.zeros((self.latency + 1, 3), zero.dtype)
        if self.gyro is not None:
            variances = jnp.concatenate([variances, self.gyro.bias_sigma**2 + self.gyro.bias**2])
            bias, rates = zero, SensorReading(inputs, jnp.zeros(self.latency + 1, bool))
        if self.momentum_noise is not None:
            variances, excess = jnp.concatenate([variances, 0 * ones]), zero
        omega = self.body.orbit.frame_rate(attitude)
        motion = MotionBelief(attitude.q, omega, zero, jnp.diag(variances), bias, excess)
        record = self.first_record(zero, gyro=self.gyro is not None)
        return DynamicsMemory(motion, inputs, inputs, rates, record)

    def step(
        self,
        sample: IntScalar,
        period: RealScalar,
        measurement: Measurement,
        memory: DynamicsMemory,
    ) -> tuple[Estimate, DynamicsMemory]:
        """The estimate with all measurements that have arrived by this sample."""
        momentum, torque = measurement.momentum, measurement.torque
        assert torque is not None
        momentum = jnp.zeros_like(torque) if momentum is None else momentum
        momenta = jnp.concatenate([memory.momenta, momentum[None]])
        torques = jnp.concatenate([memory.torques, torque[None]])
        rates = self._rates(measurement, memory.rates)
        first = sample - self.latency - 1

        def moved(number, belief: MotionBelief) -> MotionBelief:
            """The motion after the turn that begins at sample `first + number`."""
            begin = first + number
            length = jnp.where(begin >= 0, period, 0.0)  # no turn before the run
            inputs = (momenta[number], momenta[number + 1], torques[number + 1])
            time = jnp.asarray(begin, period.dtype) * period
            return apart(_moved, self, belief, *inputs, length, time)

        def gauged(number, belief: MotionBelief, record: InnovationRecord | None):
            """The motion after the gyro's reading at sample `first + number`, and the record."""
            if rates is None:
                return belief, record
            reading = SensorReading(rates.value[number], rates.seen[number])
            return apart(_gauged, self, belief, reading, record, period)

        predicted = moved(0, memory.belief)
        belief, record = apart(corrected, self, predicted, measurement, memory.record)
        belief, record = gauged(1, belief, record)
        now = (belief, record)
        if self.latency:
            now = jax.lax.fori_loop(
                *(1, self.latency + 1),
                lambda number, one: gauged(number + 1, moved(number, one[0]), one[1]),
                now,
            )
        motion, tested = now
        axes = AXES[: 2 + (self.gyro is not None)]
        sigmas = [jnp.sqrt(jnp.stack([motion.covariance[i, i] for i in of])) for of in axes]
        estimate = Estimate(Quaternion(motion.q), motion.omega, motion.bias, *sigmas)
        later = jax.tree.map(lambda one: one[1:], rates)
        after = DynamicsMemory(belief, momenta[1:], torques[1:], later, record)
        return self.with_test(estimate, tested), after

    def _rates(
        self, measurement: Measurement, earlier: SensorReading | None
    ) -> SensorReading | None:
        """The earlier readings of the gyro (rad/s) and the present one; None without a gyro."""
        rate, valid = measurement.rate, measurement.valid
        if self.gyro is None or rate is None or earlier is None:
            return None
        valid_now = jnp.all(jnp.abs(rate) < self.gyro.limit)
        valid_now = valid_now if valid is None else valid_now & valid
        values = jnp.concatenate([earlier.value, rate[None]])
        return SensorReading(values, jnp.concatenate([earlier.seen, valid_now[None]]))

    def gauged(
        self,
        belief: MotionBelief,
        reading: SensorReading,
        record: InnovationRecord | None,
        period: RealScalar,
    ) -> tuple[MotionBelief, InnovationRecord | None]:
        """The motion after a reading of the gyro (rad/s), and the record."""
        assert self.gyro is not None
        assert belief.bias is not None
        off = reading.value - belief.omega - belief.bias
        variances = (self.gyro.rate_variance(period),) * 3
        limit = None if self.test is None else self.test.attitude_threshold
        rate = (off, jnp.eye(3, dtype=off.dtype), variances, reading.seen)
        return self.tested(belief, rate, record, self.attitude_sensors, limit, *RATE_AND_BIAS)

    def moved(
        self,
        belief: MotionBelief,
        begin: Vector,
        end: Vector,
        torque: Vector,
        length: RealScalar,
        time: RealScalar,
    ) -> MotionBelief:
        """The motion one sample later.

        `begin` and `end` are the momenta (N m s) measured at both samples, `torque` (N m) is the
        commanded one between them; `length` (s) is the time between them and `time` (s) that of the
        first. The angle is the trapezoidal mean of the rates at both ends with their derivatives
        (Hermite), and the coning term; the torque acts half before and half after the turn.
        """
        excess, begin = belief.excess, jnp.where(length > 0, begin, end)
        if excess is not None:
            begin, excess = begin - excess, jnp.zeros_like(excess)
        half, attitude = length / 2, Quaternion(belief.q)
        model_torque = self.body.disturbance_torque(time + half, PlantState(attitude, belief.omega))
        torque = torque + model_torque + belief.torque
        inverse = self.body.spacecraft.inverse_inertia
        angle = self._angle(belief.omega, begin, end, torque, length)
        turn = rotation(angle)
        a = turn.as_dcm().matrix
        middle = a @ (self.body.spacecraft.inertia @ belief.omega + begin + half * torque)
        omega = inverse @ (middle + half * torque - end)
        covariance = self._covariance(belief.covariance, a, middle, length)
        q = turned(belief.q, turn, half, self.body.orbit)
        return MotionBelief(q, omega, belief.torque, covariance, belief.bias, excess)

    def _angle(
        self, omega: Vector, begin: Vector, end: Vector, torque: Vector, length: RealScalar
    ) -> Vector:
        """The angle (rad) by which the body turns; the rate at the end is by a Taylor series."""
        body = self.body.spacecraft
        inverse, inertia = body.inverse_inertia, body.inertia
        stored = (end - begin) / jnp.where(length > 0, length, 1.0)
        momentum = inertia @ omega + begin
        rate = torque - jnp.cross(omega, momentum)
        acceleration = inverse @ (rate - stored)
        second = -jnp.cross(acceleration, momentum) - jnp.cross(omega, rate)
        after = momentum + length * rate + length**2 / 2 * second
        last = inverse @ (after - end)
        change = acceleration - inverse @ (torque - jnp.cross(last, after) - stored)
        return length / 2 * (omega + last) + length**2 / 12 * (change + jnp.cross(omega, last))

    def _covariance(
        self, covariance: Float[Array, "n n"], a: Matrix, middle: Vector, length: RealScalar
    ) -> Float[Array, "n n"]:
        """The covariance one sample later, after the turn A of the body axes; `middle` is A times
        the momentum that turns.

        With h half of the time, e the error of the turn and K e = e × `middle`: e = h (A ε + ε')
        and J ε' = A (J ε - v) + h (A + 1) ξ + w + v' - K e, which is solved for ε' and
        δ' = A δ + e. w is the impulse of the white noise of torques, held in between.
        """
        body, half = self.body.spacecraft, length / 2
        inverse, identity = body.inverse_inertia, jnp.eye(3, dtype=a.dtype)
        zero, runs = jnp.zeros_like(identity), jnp.where(length > 0, 1.0, 0.0)
        m = inverse_of(identity - half * inverse @ skew(middle))  # of 1 + h J⁻¹ K
        g = m @ inverse
        both = m @ (a + inverse @ a @ body.inertia)
        by_torque = half * (g @ (a + identity))
        rows = [
            [a, half * both, half * by_torque],
            [zero, both - a, by_torque],
            [zero, zero, identity],
        ]
        noise = [[half * g, zero], [g, zero], [zero, identity]]
        torques = self.torques
        sizes = [torques.noise**2 * length * identity, torques.walk**2 * length * identity]
        if self.gyro is not None:
            rows = [*([*row, zero] for row in rows), [zero, zero, zero, identity]]
            noise = [*([*row, zero] for row in noise), [zero, zero, identity]]
            sizes.append(self.gyro.bias_walk**2 * length * identity)
        if self.momentum_noise is not None:
            late, rest = -runs * (g @ a), [zero] * (len(rows) - 2)
            more = (half * late, late, *rest)
            rows = [[*row, one] for row, one in zip(rows, more, strict=True)]
            rows.append([zero] * (len(rows) + 1))
            more = (half * runs * g, runs * g, *rest)
            noise = [[*row, one] for row, one in zip(noise, more, strict=True)]
            noise.append([*([zero] * len(sizes)), identity])
            sizes.append(self.momentum_noise)
        transition = jnp.block(rows)
        after = transition @ covariance @ transition.T
        for column, size in zip(zip(*noise, strict=True), sizes, strict=True):
            by = jnp.concatenate(column)
            after = after + by @ size @ by.T
        return (after + after.T) / 2


AXES = (range(3), range(3, 6), range(9, 12))
"""Rows of the covariance of attitude, rate, and bias with a gyro."""

RATE_AND_BIAS = (1, 3)
"""Errors, in the order of those of `MotionBelief`, of which a gyro measures the sum."""


@eqx.filter_jit
def _moved(estimator: DynamicsFilter, belief: MotionBelief, *arguments: Array) -> MotionBelief:
    return estimator.moved(belief, *arguments)


@eqx.filter_jit
def _gauged(
    estimator: DynamicsFilter,
    belief: MotionBelief,
    reading: SensorReading,
    record: InnovationRecord | None,
    period: RealScalar,
) -> tuple[MotionBelief, InnovationRecord | None]:
    return estimator.gauged(belief, reading, record, period)
