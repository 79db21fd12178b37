"""An estimator of a package's own."""

import jax
import jax.numpy as jnp

from jaxsat import PartDeclaration
from jaxsat.control.navigation import AbstractEstimator, Estimate, difference
from jaxsat.core.declaration import number
from jaxsat.spacecraft.environment import AbstractOrbit


class FixedGains(AbstractEstimator):
    """Sums up the rates, and pulls attitude and bias towards each attitude that arrives."""

    declaration = PartDeclaration(
        summary="fixed gains in place of a Kalman filter's",
        keys=(
            number("attitude_gain", "Part of the error taken out", at_least=0, at_most=1),
            number("bias_gain_1_s", "Bias per angle of error", "1/s", at_least=0, default=0.0),
        ),
    )

    orbit: AbstractOrbit
    attitude_gain: jax.Array
    bias_gain: jax.Array

    @classmethod
    def from_table(cls, values, context):
        gains = (values["attitude_gain"], values["bias_gain_1_s"])
        return cls(context.orbit, *(jnp.asarray(gain, float) for gain in gains))

    def init(self, attitude, sigma):
        return attitude, jnp.zeros(3)

    def step(self, sample, period, measurement, memory):
        attitude, bias = memory
        error = difference(attitude, measurement.attitude)
        error = jnp.where(measurement.seen, error, 0.0)
        attitude = attitude.turned(self.attitude_gain * error)
        bias = bias - self.bias_gain * error
        rate = measurement.rate - bias
        following = attitude.turned(period * (rate - self.orbit.frame_rate(attitude)))
        return Estimate(attitude, rate, bias), (following, bias)
