"""A multiplicative extended Kalman filter: attitude error and gyro bias, six states."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.navigation.estimator import Estimate, Measurement, rotation
from jaxsat.control.navigation.innovation import InnovationRecord, InnovationTest
from jaxsat.control.navigation.kalman_filter import AbstractKalmanFilter, Gains, corrected, turned
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.trees import apart
from jaxsat.spacecraft.environment.orbit import AbstractOrbit
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker


class AttitudeBelief(NamedTuple):
    """Attitude and gyro bias at one sample with the covariances of their errors.

    With the true attitude q ⊗ (1, δ/2) and the true bias b + β: `attitude` is E δδᵀ (rad²), `cross`
    E δβᵀ and `bias` E ββᵀ. The rate measured at this sample, whose noise is n, also turns the
    attitude after it; `attitude_noise` is E δnᵀ and `bias_noise` E βnᵀ.
    """

    q: Float[Array, "4"]
    b: Vector
    attitude: Matrix
    cross: Matrix
    bias: Matrix
    attitude_noise: Matrix
    bias_noise: Matrix

    def narrowed(
        self, axis: Vector, variance: RealScalar, valid: BoolScalar
    ) -> "tuple[AttitudeBelief, Gains]":
        """The covariances after a measurement of δ along an axis with this variance (rad²)."""
        attitude, bias = self.attitude @ axis, axis @ self.cross
        scale = jnp.where(valid, 1 / (axis @ attitude + variance), 0.0)
        noise = scale * (axis @ self.attitude_noise)
        narrowed = self._replace(
            attitude=self.attitude - scale * _outer(attitude, attitude),
            cross=self.cross - scale * _outer(attitude, bias),
            bias=self.bias - scale * _outer(bias, bias),
            attitude_noise=self.attitude_noise - _outer(attitude, noise),
            bias_noise=self.bias_noise - _outer(bias, noise),
        )
        return narrowed, Gains((attitude, bias), scale)

    def shifted(self, attitude: Vector, bias: Vector) -> "AttitudeBelief":
        """The belief turned by a small rotation (rad), with a change of the bias (rad/s)."""
        return self._replace(q=Quaternion(self.q).turned(attitude).q, b=self.b + bias)


class KalmanMemory(NamedTuple):
    """The belief at the sample of the latest arrivals, and the rates since (rad/s).

    `record` is that of the innovation test, None without one.
    """

    belief: AttitudeBelief
    rates: Float[Array, "samples 3"]
    record: InnovationRecord | None = None


class MultiplicativeFilter(AbstractKalmanFilter):
    """The multiplicative extended Kalman filter of Lefferts, Markley and Shuster (1982).

    Between samples the attitude turns by the trapezoidal mean of the measured rates less the
    estimated bias, with the coning term, and by the orbit frame's own motion. As a rate enters the
    turns before and after its sample, its noise is correlated from one turn to the next; the filter
    carries that correlation, so that its covariance is that of its errors. An attitude is processed
    as three scalar measurements about the star tracker's axes, a vector v as those of the rows of
    [v ×]: no matrix is inverted.

    Measurements with latency belong to an earlier sample. The filter itself stays at that sample
    and predicts from there with the later rates, which is exact.

    `gyro`, `tracker` and `orbit` are the filter's models; `vector_noise` are the standard
    deviations of the sensors of vectors, in their units, and `vector_latency` is their latency in
    samples. A rate at the gyro's limit is treated as unknown within that limit, so that the next
    measurement decides. Scale factors and misalignments are not estimated, nor is the bias of a
    magnetometer. With a `test` the filter leaves out what does not agree with its prediction.
    """

    orbit: AbstractOrbit
    gyro: Gyro
    tracker: StarTracker | None
    vector_noise: tuple[RealScalar, ...] = ()
    vector_latency: int = eqx.field(static=True, default=0)
    test: InnovationTest | None = None

    def init(self, attitude: Quaternion, sigma: RealScalar) -> KalmanMemory:
        """A belief without correlations and with zero bias.

        The bias variance is declared by the gyro: that of the draw, plus the square of the rest.
        """
        identity = jnp.eye(3, dtype=attitude.q.dtype)
        zero = jnp.zeros_like(identity)
        bias = identity * (self.gyro.bias_sigma**2 + self.gyro.bias**2)[:, None]
        belief = AttitudeBelief(attitude.q, zero[0], sigma**2 * identity, zero, bias, zero, zero)
        rates = jnp.zeros((self.latency + 1, 3), zero.dtype)
        return KalmanMemory(belief, rates, self.first_record(zero))

    def step(
        self, sample: IntScalar, period: RealScalar, measurement: Measurement, memory: KalmanMemory
    ) -> tuple[Estimate, KalmanMemory]:
        """The estimate with all measurements that have arrived by this sample."""
        assert measurement.rate is not None
        rates = jnp.concatenate([memory.rates, measurement.rate[None]])
        first = sample - self.latency - 1

        def moved(number, belief: AttitudeBelief) -> AttitudeBelief:
            """The belief after the turn that begins at sample `first + number`."""
            length = jnp.where(first + number >= 0, period, 0.0)  # no turn before the run
            arguments = (rates[number], rates[number + 1], length, period)
            return apart(_moved, self, belief, *arguments)

        predicted = moved(0, memory.belief)
        belief, record = apart(corrected, self, predicted, measurement, memory.record)
        now = belief
        if self.latency:
            now = jax.lax.fori_loop(1, self.latency + 1, moved, belief)
        estimate = self._estimate(now, measurement.rate, period)
        return self.with_test(estimate, record), KalmanMemory(belief, rates[1:], record)

    def moved(
        self,
        belief: AttitudeBelief,
        begin: Vector,
        end: Vector,
        length: RealScalar,
        period: RealScalar,
    ) -> AttitudeBelief:
        """The belief one sample later, for the rates measured at both samples (rad/s).

        `length` (s) is the time between them. With h half of it, A the turn of the body axes and
        w the step of the bias, δ' = Aδ - h (A (β + n) + β + w + n').
        """
        half, rates = length / 2, (begin - belief.b, end - belief.b)
        angle = half * (rates[0] + rates[1]) + length**2 / 12 * jnp.cross(*rates)
        turn = rotation(angle)
        a, identity = turn.as_dcm().matrix, jnp.eye(3, dtype=angle.dtype)
        g = half * (a + identity)
        before, after = (identity * self._variance(rate, period)[:, None] for rate in (begin, end))
        walk = identity * (self.gyro.bias_walk**2 * length)
        # the predicted δ against δ, β and n of before
        with_attitude = a @ (belief.attitude - half * belief.attitude_noise.T) - g @ belief.cross.T
        with_bias = a @ (belief.cross - half * belief.bias_noise.T) - g @ belief.bias
        with_noise = a @ (belief.attitude_noise - half * before) - g @ belief.bias_noise
        attitude = (with_attitude - half * with_noise) @ a.T - with_bias @ g.T
        attitude = (attitude + attitude.T) / 2 + half**2 * (walk + after)
        return AttitudeBelief(
            turned(belief.q, turn, half, self.orbit),
            belief.b,
            attitude,
            with_bias - half * walk,
            belief.bias + walk,
            -half * after,
            jnp.zeros_like(after),
        )

    def _variance(self, rate, period) -> Vector:
        """Variance of a measured rate about each axis; that of the whole range at its limit."""
        within_limit = jnp.abs(rate) < self.gyro.limit
        return jnp.where(within_limit, self.gyro.rate_variance(period), self.gyro.limit**2)

    def _estimate(self, belief: AttitudeBelief, rate, period) -> Estimate:
        of_bias = _diagonal(belief.bias)
        of_rate = of_bias + self._variance(rate, period) + 2 * _diagonal(belief.bias_noise)
        deviations = map(jnp.sqrt, (_diagonal(belief.attitude), of_rate, of_bias))
        return Estimate(Quaternion(belief.q), rate - belief.b, belief.b, *deviations)


@eqx.filter_jit
def _moved(
    estimator: MultiplicativeFilter, belief: AttitudeBelief, *arguments: Array
) -> AttitudeBelief:
    return estimator.moved(belief, *arguments)


def _outer(x: Vector, y: Vector) -> Matrix:
    return x[:, None] * y[None, :]


def _diagonal(matrix: Matrix) -> Vector:
    return jnp.stack([matrix[0, 0], matrix[1, 1], matrix[2, 2]])
