"""Estimate of the ripple by the periodic d3 of (2) about the axis without a torque.

Nothing can cancel d3. It causes a ripple of a3 / (J3 Ω) in ω3 and a3 / (J3 Ω²) in z, which a law
that steers the third axis must know in order to ignore it.
"""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.quotients import reciprocal

LEAST_SIGMAS, SURE_SIGMAS = 2.0, 4.0
"""Standard deviations of a steady acceleration below which it is ignored, and from which it is
fully used. Between them a share is used, so that an estimate near either does not switch the law
back and forth."""


class ThirdRate(NamedTuple):
    """ω3 (rad/s), and the zero-mean ripples of ω3 (rad/s) and of z (rad) within it.

    `steady` (rad/s²) is the effect of a constant torque on dω3/dt, `None` if it is not estimated.
    """

    rate: RealScalar
    rate_ripple: RealScalar
    turn_ripple: RealScalar
    steady: RealScalar | None = None


class RippleBelief(NamedTuple):
    """Mean of ω3, the ripple and its quadrature, all rad/s, and their covariance.

    A fourth state, if there is one, is the steady acceleration (rad/s²).
    """

    state: Float[Array, " states"]
    covariance: Float[Array, "states states"]


class Steady(NamedTuple):
    """Prior of the acceleration by a constant torque.

    Its expected `size` (rad/s²), its `drift` (rad/s² per √s), and the `rate_limit` (rad/s) on ω1
    and ω2 above which it is not learnt: the errors of c ω1 ω2 are not random.
    """

    size: RealScalar
    drift: RealScalar
    rate_limit: RealScalar


class RippleFilter(eqx.Module):
    """A Kalman filter of ω3 and of a sinusoidal d3, from the measured rates sample by sample.

    At first it learns in a fraction of the disturbance's period, later it averages the sensor's
    noise. Rates of ω1 and ω2 raise its uncertainty instead of disabling it: the predicted ω3 is
    uncertain by `product_error` |ω|², `lean_error` |ω| (dimensionless). `frequency` is Ω (rad/s),
    `noise` the sensor's (rad/s), `amplitude` the ripple's expected size (rad/s), and `drift` the
    random walk of the ripple (rad/s per √s), which also follows a nearby frequency. With `steady`
    it also estimates the acceleration by a constant torque.
    """

    frequency: RealScalar = eqx.field(converter=positive("frequency"))
    noise: RealScalar = eqx.field(converter=positive("noise"))
    amplitude: RealScalar = eqx.field(converter=positive("amplitude"))
    drift: RealScalar = eqx.field(converter=positive("drift"))
    product_error: RealScalar = eqx.field(converter=positive("product_error"))
    lean_error: RealScalar = eqx.field(converter=positive("lean_error"), default=0.003)
    steady: Steady | None = None

    def init(self, omega3: RealScalar) -> RippleBelief:
        """The belief after the first measurement, mean plus ripple, with the mean unknown."""
        zero, noise, size = jnp.zeros_like(omega3), self.noise**2, self.amplitude**2
        covariance = jnp.stack(
            [
                jnp.stack([noise + size, -size, zero]),
                jnp.stack([-size, size + zero, zero]),
                jnp.stack([zero, zero, size + zero]),
            ]
        )
        state = jnp.stack([omega3, zero, zero])
        if self.steady is None:
            return RippleBelief(state, covariance)
        covariance = jnp.pad(covariance, (0, 1)).at[3, 3].set(self.steady.size**2)
        return RippleBelief(jnp.append(state, 0.0), covariance)

    def advance(
        self, memory: RippleBelief, omega: Vector, change: RealScalar, period: RealScalar
    ) -> RippleBelief:
        """Predict: the mean moves by `change`, the ripple turns by Ω `period`, variances grow."""
        cos, sin = jnp.cos(self.frequency * period), jnp.sin(self.frequency * period)
        model_error = self.product_error * (omega[0] ** 2 + omega[1] ** 2)
        spread = [model_error**2, self.drift**2, self.drift**2]
        state = _moved(memory.state, cos, sin, period).at[0].add(change)
        covariance = _moved(_moved(memory.covariance, cos, sin, period).T, cos, sin, period)
        if self.steady is not None:
            spread.append(self.steady.drift**2)
            calm = jnp.maximum(jnp.abs(omega[0]), jnp.abs(omega[1])) < self.steady.rate_limit
            alone = covariance.at[3, :3].set(0.0).at[:3, 3].set(0.0)
            covariance = jnp.where(calm, covariance, alone)
        return RippleBelief(state, covariance + jnp.diag(period * jnp.stack(spread)))

    def correct(self, memory: RippleBelief, omega: Vector) -> RippleBelief:
        """Update by one measurement, the sum of mean and ripple."""
        size = omega[0] ** 2 + omega[1] ** 2
        cross = memory.covariance[0] + memory.covariance[1]
        variance = cross[0] + cross[1] + self.noise**2 + self.lean_error**2 * size
        gain = cross * reciprocal(variance)
        error = omega[2] - memory.state[0] - memory.state[1]
        covariance = memory.covariance - gain[:, None] * cross[None, :]
        return RippleBelief(memory.state + gain * error, covariance)

    def believed(self, memory: RippleBelief) -> ThirdRate:
        """The filtered ω3 and its ripples; the ripple's integral is its quadrature over Ω."""
        mean, ripple, quadrature = memory.state[:3]
        steady = None
        if self.steady is not None:
            squared = memory.state[3] ** 2 * reciprocal(memory.covariance[3, 3])
            least, sure = LEAST_SIGMAS**2, SURE_SIGMAS**2
            steady = memory.state[3] * jnp.clip((squared - least) / (sure - least), 0.0, 1.0)
        return ThirdRate(mean + ripple, ripple, quadrature / self.frequency, steady)


def _moved(
    rows: Float[Array, " states *n"], cos: RealScalar, sin: RealScalar, period: RealScalar
) -> Float[Array, " states *n"]:
    """The rows with the second and third (ripple) turned; the fourth moves the first."""
    first, second, third, *steady = rows
    for acceleration in steady:
        first = first + period * acceleration
    return jnp.stack([first, cos * second - sin * third, sin * second + cos * third, *steady])
