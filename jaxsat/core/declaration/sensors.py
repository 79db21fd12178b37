"""The keys of what is between a sampled law and the plant.

`[sampling]`, or `[gyro]` and `[star_tracker]` with `[estimator]` behind them.
"""

from jaxsat.core.declaration.keys import choice, number
from jaxsat.core.ranges import (
    ATTITUDE_NOISE,
    GYRO_BIAS,
    MISALIGNMENT,
    RATE_NOISE,
    RATE_RANGE,
    SCALE_FACTOR,
    SECONDS,
    TRACKER_NOISE,
)

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
"""Those that `jaxsat.spacecraft.Sensors` is made of."""

DELAY = number(
    "delay_s",
    "Time from a sample to its torque, at most one period of the law",
    "s",
    at_least=0,
    at_most=SECONDS.high,
    default=0.0,
)

GYRO_KEYS = (
    number(
        "noise_density_rad_s_sqrt_Hz",
        "Density of the white noise on each measured rate (angle random walk)",
        "rad/s/√Hz",
        at_least=RATE_NOISE.low,
        at_most=RATE_NOISE.high,
        default=0.0,
    ),
    number(
        "bias_walk_rad_s2_sqrt_Hz",
        "Density of the white noise that moves each bias (rate random walk)",
        "rad/s²/√Hz",
        at_least=RATE_NOISE.low,
        at_most=RATE_NOISE.high,
        default=0.0,
    ),
    number(
        "bias_rad_s",
        "Bias at the start, of all axes or of each",
        "rad/s",
        at_least=GYRO_BIAS.low,
        at_most=GYRO_BIAS.high,
        size=3,
        or_one=True,
        default=0.0,
    ),
    number(
        "bias_sigma_rad_s",
        "Standard deviation of what is drawn onto each bias at the start",
        "rad/s",
        at_least=RATE_NOISE.low,
        at_most=RATE_NOISE.high,
        default=0.0,
    ),
    number(
        "scale_factor",
        "Relative error of the measured rate, of all axes or of each",
        "1",
        at_least=SCALE_FACTOR.low,
        at_most=SCALE_FACTOR.high,
        size=3,
        or_one=True,
        default=0.0,
    ),
    number(
        "misalignment_rad",
        "Small rotation of the three input axes, in body axes",
        "rad",
        at_least=MISALIGNMENT.low,
        at_most=MISALIGNMENT.high,
        size=3,
        default=(0.0, 0.0, 0.0),
    ),
    number(
        "limit_rad_s",
        "Largest rate that an axis can tell; by default none",
        "rad/s",
        at_least=RATE_RANGE.low,
        at_most=RATE_RANGE.high,
        default=None,
    ),
)
"""Those that `jaxsat.spacecraft.Gyro` is made of."""

TRACKER_KEYS = (
    number(
        "across_rad",
        "Standard deviation of the measured attitude about each direction across the boresight",
        "rad",
        at_least=TRACKER_NOISE.low,
        at_most=TRACKER_NOISE.high,
    ),
    number(
        "along_rad",
        "Standard deviation of the measured attitude about the boresight",
        "rad",
        at_least=TRACKER_NOISE.low,
        at_most=TRACKER_NOISE.high,
    ),
    number(
        "boresight",
        "Direction of the boresight in body axes",
        "1",
        at_least=-1e6,
        at_most=1e6,
        size=3,
        default=(0.0, 0.0, 1.0),
    ),
    number(
        "update_period_s",
        "Time between measurements, a whole multiple of control.period_s, which it is by default",
        "s",
        at_least=SECONDS.low,
        at_most=SECONDS.high,
        default=None,
    ),
    number(
        "latency_s",
        "Time from a measurement to its arrival, a whole multiple of control.period_s, or zero",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=0.0,
    ),
    number(
        "rate_limit_rad_s",
        "Largest size of ω at which there are measurements; by default none",
        "rad/s",
        at_least=RATE_RANGE.low,
        at_most=RATE_RANGE.high,
        default=None,
    ),
    number(
        "outage_start_s",
        "Time at which an outage begins, in which nothing is measured; by default none",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=None,
    ),
    number(
        "outage_s",
        "Length of the outage",
        "s",
        at_least=0,
        at_most=SECONDS.high,
        default=None,
    ),
)
"""Those that `jaxsat.spacecraft.StarTracker` is made of."""

ESTIMATORS = ("mekf", "none")
"""Those that come with jaxsat."""

ESTIMATOR = choice(
    "kind",
    'What the law is told: the estimates of a multiplicative extended Kalman filter ("mekf"), '
    'or what was measured last ("none")',
    ESTIMATORS,
    "mekf",
)

ATTITUDE_SIGMA = number(
    "attitude_sigma_rad",
    "Standard deviation of what is drawn onto the first estimate of the attitude, about each axis",
    "rad",
    at_least=0,
    at_most=TRACKER_NOISE.high,
    default=0.01,
)
