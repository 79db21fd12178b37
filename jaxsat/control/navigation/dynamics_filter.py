"""A multiplicative extended Kalman filter without a gyro: attitude error, rate and torque."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.navigation.estimator import Estimate, Measurement, rotation
from jaxsat.control.navigation.innovation import InnovationRecord, InnovationTest
from jaxsat.control.navigation.kalman_filter import AbstractKalmanFilter, Gains, corrected, turned
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion, skew
from jaxsat.core.checks import as_optional_float, not_negative
from jaxsat.core.trees import apart
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.navigation_sensors import StarTracker
from jaxsat.spacecraft.spacecraft import inverse_of

ESTIMATED = 9
"""Attitude, rate and torque; the noise of tachometers follows, which is not estimated."""


class TorqueModel(eqx.Module):
    """What the filter supposes of the torques that nobody commands, the same about each axis.

    They are white noise with the density `noise` (N m/√Hz), and a torque that is fixed in body axes
    but for a random walk with the density `walk` (N m/s/√Hz), which begins with the standard
    deviation `sigma` (N m). Raises `ValueError` for a number below zero.
    """

    noise: RealScalar = eqx.field(converter=not_negative("noise"))
    sigma: RealScalar = eqx.field(converter=not_negative("sigma"), default=0.0)
    walk: RealScalar = eqx.field(converter=not_negative("walk"), default=0.0)


class Motion(NamedTuple):
    """Attitude, rate (rad/s) and unknown torque (N m) at one sample, with the covariance of their
    errors.

    With the true attitude q ⊗ (1, δ/2), the true rate ω + ε and torque d + ξ, and v the error of
    the momentum measured at this sample (N m s, body axes), `covariance` is that of δ, ε, ξ and v;
    exact tachometers have no v.
    """

    q: Float[Array, "4"]
    omega: Vector
    torque: Vector
    covariance: Float[Array, "n n"]

    def narrowed(
        self, axis: Vector, variance: RealScalar, valid: BoolScalar
    ) -> tuple["Motion", Gains]:
        """The covariance after a measurement of δ along an axis with this variance (rad²).

        That of v stays, as v is not estimated (Schmidt's consider filter).
        """
        column = self.covariance[:, :3] @ axis
        scale = jnp.where(valid, 1 / (axis @ column[:3] + variance), 0.0)
        considered = column.at[:ESTIMATED].set(0.0)
        change = _outer(column, column) - _outer(considered, considered)
        gains = tuple(column[begin : begin + 3] for begin in range(0, ESTIMATED, 3))
        narrowed = self._replace(covariance=self.covariance - scale * change)
        return narrowed, Gains(gains, scale)

    def shifted(self, attitude: Vector, omega: Vector, torque: Vector) -> "Motion":
        """The motion turned by a small rotation (rad), with changes of rate and torque."""
        q = Quaternion(self.q).turned(attitude).q
        return Motion(q, self.omega + omega, self.torque + torque, self.covariance)


class DynamicsMemory(NamedTuple):
    """The motion at the sample of the latest arrivals, and the inputs since.

    `momenta` (N m s) were measured at the samples, `torques` (N m) commanded in the periods that
    end there. `record` is that of the innovation test, None without one.
    """

    belief: Motion
    momenta: Float[Array, "samples 3"]
    torques: Float[Array, "samples 3"]
    record: InnovationRecord | None = None


class DynamicsFilter(AbstractKalmanFilter):
    """A multiplicative extended Kalman filter that predicts the rate by Euler's equation.

    Lefferts, Markley and Shuster (1982) replace the dynamics by a gyro; here they stay. Between
    samples the total momentum H = J ω + h of the `body` moves by the commanded torque of thrusters
    and magnetorquers, the body's modelled disturbance and the estimated torque, while h, that of
    the devices which store momentum, is measured: so the filter needs neither their commands nor
    their friction. `momentum_noise` (N² m² s²) is the covariance of the measured h, None for an
    exact one; its error is correlated from one turn to the next, which the filter carries.

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

    def init(self, attitude: Quaternion, sigma: RealScalar) -> DynamicsMemory:
        """A motion at rest in the orbit frame, without correlations and without a torque."""
        zero = jnp.zeros(3, attitude.q.dtype)
        ones = jnp.ones_like(zero)
        deviations = (sigma, self.rate_sigma, self.torques.sigma)
        variances = jnp.concatenate([deviation**2 * ones for deviation in deviations])
        if self.momentum_noise is not None:
            variances = jnp.concatenate([variances, 0 * ones])
        covariance = jnp.diag(variances)
        omega = self.body.orbit.frame_rate(attitude)
        inputs = jnp.zeros((self.latency + 1, 3), zero.dtype)
        record = self.first_record(zero)
        return DynamicsMemory(Motion(attitude.q, omega, zero, covariance), inputs, inputs, record)

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
        first = sample - self.latency - 1

        def moved(number, belief: Motion) -> Motion:
            """The motion after the turn that begins at sample `first + number`."""
            begin = first + number
            length = jnp.where(begin >= 0, period, 0.0)  # no turn before the run
            inputs = (momenta[number], momenta[number + 1], torques[number + 1])
            time = jnp.asarray(begin, period.dtype) * period
            return apart(_moved, self, belief, *inputs, length, time)

        predicted = moved(0, memory.belief)
        belief, record = apart(corrected, self, predicted, measurement, memory.record)
        now = belief
        if self.latency:
            now = jax.lax.fori_loop(1, self.latency + 1, moved, belief)
        sigmas = [jnp.sqrt(jnp.stack([now.covariance[i, i] for i in of])) for of in AXES]
        estimate = Estimate(Quaternion(now.q), now.omega, None, *sigmas)
        after = DynamicsMemory(belief, momenta[1:], torques[1:], record)
        return self.with_test(estimate, record), after

    def moved(
        self,
        belief: Motion,
        begin: Vector,
        end: Vector,
        torque: Vector,
        length: RealScalar,
        time: RealScalar,
    ) -> Motion:
        """The motion one sample later.

        `begin` and `end` are the momenta (N m s) measured at both samples, `torque` (N m) is the
        commanded one between them; `length` (s) is the time between them and `time` (s) that of the
        first. The angle is the trapezoidal mean of the rates at both ends with their derivatives
        (Hermite), and the coning term; the torque acts half before and half after the turn.
        """
        begin = jnp.where(length > 0, begin, end)
        half, attitude = length / 2, Quaternion(belief.q)
        known = self.body.disturbance_torque(time + half, PlantState(attitude, belief.omega))
        torque = torque + known + belief.torque
        inverse = self.body.spacecraft.inverse_inertia
        angle = self._angle(belief.omega, begin, end, torque, length)
        turn = rotation(angle)
        a = turn.as_dcm().matrix
        middle = a @ (self.body.spacecraft.inertia @ belief.omega + begin + half * torque)
        omega = inverse @ (middle + half * torque - end)
        covariance = self._covariance(belief.covariance, a, middle, length)
        return Motion(
            turned(belief.q, turn, half, self.body.orbit), omega, belief.torque, covariance
        )

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
        if self.momentum_noise is not None:
            late = -runs * (g @ a)
            rows = [[*row, more] for row, more in zip(rows, (half * late, late, zero), strict=True)]
            rows.append([zero] * 4)
            more = (half * runs * g, runs * g, zero)
            noise = [[*row, one] for row, one in zip(noise, more, strict=True)]
            noise.append([zero, zero, identity])
            sizes.append(self.momentum_noise)
        transition = jnp.block(rows)
        moved = transition @ covariance @ transition.T
        for column, size in zip(zip(*noise, strict=True), sizes, strict=True):
            by = jnp.concatenate(column)
            moved = moved + by @ size @ by.T
        return (moved + moved.T) / 2


AXES = (range(3), range(3, 6))
"""Rows of the covariance of attitude and rate."""


@eqx.filter_jit
def _moved(estimator: DynamicsFilter, belief: Motion, *arguments: Array) -> Motion:
    return estimator.moved(belief, *arguments)


def _outer(x: Array, y: Array) -> Array:
    return x[:, None] * y[None, :]
