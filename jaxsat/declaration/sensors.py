"""The keys of `[sampling]`: what is between a sampled law and the plant."""

from jaxsat.declaration.keys import number
from jaxsat.ranges import ATTITUDE_NOISE, RATE_NOISE, SECONDS

SENSOR_KEYS = (
    number(
        "rate_noise_rad_s",
        "Standard deviation of white noise on each measured rate, a sample",
        "rad/s",
        at_least=RATE_NOISE.low,
        at_most=RATE_NOISE.high,
        default=0.0,
    ),
    number(
        "attitude_noise_rad",
        "Standard deviation of the measured attitude about each body axis, a sample",
        "rad",
        at_least=ATTITUDE_NOISE.low,
        at_most=ATTITUDE_NOISE.high,
        default=0.0,
    ),
)
"""Those that `jaxsat.vehicle.Sensors` is made of."""

DELAY = number(
    "delay_s",
    "Time from a sample to its torque, at most one period of the law",
    "s",
    at_least=0,
    at_most=SECONDS.high,
    default=0.0,
)
