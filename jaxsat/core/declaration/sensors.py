"""`[sampling]`, `[gyro]`, `[star_tracker]`, and sensors of vectors known along the orbit."""

from jaxsat.core.declaration.keys import DispersibleQuantity, Key, PartDeclaration, number
from jaxsat.core.declaration.sensor import (
    GyroFailureKind,
    SensorDeclaration,
    SensorFailureKind,
    boresight,
    measurement_times,
    misalignment,
    outage,
)
from jaxsat.core.ranges import (
    ATTITUDE_NOISE,
    FIELD_BIAS,
    FIELD_NOISE,
    FROM_ZERO,
    GYRO_BIAS,
    HALF_ANGLE,
    RATE_NOISE,
    RATE_RANGE,
    SCALE_FACTOR,
    SECONDS,
    TRACKER_NOISE,
)

WHITE_NOISE = PartDeclaration(
    "sensors with white noise",
    (
        number(
            "rate_noise_rad_s",
            "Standard deviation of white noise on each measured rate, per sample",
            within=RATE_NOISE,
            default=0.0,
            drawn="rate_noise",
        ),
        number(
            "attitude_noise_rad",
            "Standard deviation of the measured attitude about each body axis, per sample",
            within=ATTITUDE_NOISE,
            default=0.0,
            drawn="attitude_noise",
        ),
    ),
)
"""Declaration of the white noise in `[sampling]`."""

DELAY = number(
    "delay_s",
    "Time from a sample to its torque, at most one period of the law",
    within=FROM_ZERO,
    default=0.0,
)

PATIENCE = 5
"""Default number of readings in a row that are rejected before a sensor is excluded."""

PROBATION = 100
"""Default number of readings in a row that agree before an excluded sensor is used again."""

HOLD_SAMPLES = 10
"""Default number of samples with invalid measurements for which commands are held."""

GYRO = SensorDeclaration(
    name="gyro",
    meaning="Rate gyros of a sampled law",
    place="navigation.gyro",
    maker="jaxsat.spacecraft.navigation_sensors:Gyro.from_table",
    summary="rate gyros",
    kinds=tuple(GyroFailureKind),
    keys=(
        number(
            "noise_density_rad_s_sqrt_Hz",
            "Density of the white noise on each measured rate (angle random walk)",
            within=RATE_NOISE,
            default=0.0,
            drawn="gyro_noise_density",
        ),
        number(
            "bias_walk_rad_s2_sqrt_Hz",
            "Density of the white noise that moves each bias (rate random walk)",
            within=RATE_NOISE,
            default=0.0,
            drawn="gyro_bias_walk",
        ),
        number(
            "bias_rad_s",
            "Bias at the start, of all axes or of each",
            within=GYRO_BIAS,
            size=(1, 3),
            default=0.0,
            drawn="gyro_bias",
        ),
        number(
            "bias_sigma_rad_s",
            "Standard deviation of the random part of each bias at the start",
            within=RATE_NOISE,
            default=0.0,
        ),
        number(
            "scale_factor",
            "Relative error of the measured rate, of all axes or of each",
            within=SCALE_FACTOR,
            size=(1, 3),
            default=0.0,
            drawn="gyro_scale_factor",
        ),
        misalignment("Small rotation of the three input axes, in body axes", "gyro_misalignment"),
        number(
            "limit_rad_s",
            "Largest rate that an axis can measure; by default unlimited",
            within=RATE_RANGE,
            default=None,
        ),
        *outage("gyros", "gyro", start=SECONDS),
    ),
)

STAR_TRACKER = SensorDeclaration(
    name="star_tracker",
    meaning="Star tracker of a sampled law",
    place="navigation.tracker",
    maker="jaxsat.spacecraft.navigation_sensors:StarTracker.from_table",
    summary="star tracker",
    kinds=tuple(SensorFailureKind),
    keys=(
        number(
            "across_rad",
            "Standard deviation of the measured attitude about each direction across the boresight",
            within=TRACKER_NOISE,
            drawn="tracker_across",
        ),
        number(
            "along_rad",
            "Standard deviation of the measured attitude about the boresight",
            within=TRACKER_NOISE,
            drawn="tracker_along",
        ),
        boresight("the boresight"),
        *measurement_times(drawn="tracker"),
        number(
            "rate_limit_rad_s",
            "Largest |ω| at which there are measurements; by default unlimited",
            within=RATE_RANGE,
            default=None,
            drawn="tracker_rate_limit",
        ),
        *outage("star tracker", "tracker"),
    ),
    dispersible=(
        DispersibleQuantity(
            "tracker_update_period",
            "time between the star tracker's measurements, rounded to whole control periods",
            "s",
        ),
        DispersibleQuantity(
            "tracker_latency",
            "time until the star tracker's measurement arrives, rounded to whole control "
            "periods, at most star_tracker.latency_s",
            "s",
        ),
    ),
)


def _common_keys(name: str, noise: Key) -> tuple[Key, ...]:
    """Return the common keys: noise, misalignment, times of measurements, and an outage."""
    return (
        noise,
        misalignment("Small rotation of the measured vector, in body axes", f"{name}_misalignment"),
        *measurement_times("; measurements of faster sensors wait for the slowest"),
        *outage(name.replace("_", " "), name),
    )


def _direction_keys(name: str) -> tuple[Key, ...]:
    """Return the keys of direction sensors: noise across the direction, and a field of view."""
    noise = number(
        "noise_rad",
        "Standard deviation of the measured direction about each axis across it",
        within=TRACKER_NOISE,
        drawn=f"{name}_noise",
    )
    return (
        *_common_keys(name, noise),
        boresight("the middle of the field of view"),
        number(
            "half_angle_rad",
            "Half of the angle of the conical field of view; by default everything is in view",
            within=HALF_ANGLE,
            default=None,
        ),
    )


MAGNETOMETER = SensorDeclaration(
    name="magnetometer",
    meaning="Three-axis magnetometer of a sampled law",
    place="navigation.magnetometer",
    maker="jaxsat.spacecraft.vector_sensors:magnetometer",
    summary="magnetometer",
    kinds=tuple(SensorFailureKind),
    keys=(
        *_common_keys(
            "magnetometer",
            number(
                "noise_T",
                "Standard deviation of white noise on each component of the measured field",
                within=FIELD_NOISE,
                drawn="magnetometer_noise",
            ),
        ),
        number(
            "bias_T",
            "Error of the measured field that is fixed in body axes, of all or of each",
            within=FIELD_BIAS,
            size=(1, 3),
            default=0.0,
            drawn="magnetometer_bias",
        ),
        number(
            "scale_factor",
            "Relative error of the measured field, of all axes or of each",
            within=SCALE_FACTOR,
            size=(1, 3),
            default=0.0,
            drawn="magnetometer_scale_factor",
        ),
    ),
)

SUN_SENSOR = SensorDeclaration(
    name="sun_sensor",
    meaning="Sun sensor of a sampled law",
    place="navigation.sun_sensor",
    maker="jaxsat.spacecraft.vector_sensors:sun_sensor",
    summary="Sun sensor",
    kinds=tuple(SensorFailureKind),
    keys=_direction_keys("sun_sensor"),
)

HORIZON_SENSOR = SensorDeclaration(
    name="horizon_sensor",
    meaning="Horizon sensor of a sampled law",
    place="navigation.horizon_sensor",
    maker="jaxsat.spacecraft.vector_sensors:horizon_sensor",
    summary="horizon sensor",
    kinds=tuple(SensorFailureKind),
    keys=_direction_keys("horizon_sensor"),
)

ATTITUDE_SENSORS: tuple[SensorDeclaration, ...] = (
    STAR_TRACKER,
    MAGNETOMETER,
    SUN_SENSOR,
    HORIZON_SENSOR,
)
"""Intermittent sensors of the attitude; after the first the sensors of vectors."""

FILTER_SENSORS: tuple[SensorDeclaration, ...] = (*ATTITUDE_SENSORS, GYRO)
"""Sensors whose readings a filter tests, in its order; the gyro if it predicts by the dynamics."""

SENSORS: tuple[SensorDeclaration, ...] = (GYRO, *ATTITUDE_SENSORS)
"""Sensors with a table of their own, in the order of a scenario."""

SENSED = {"sensors": WHITE_NOISE} | {one.place: one for one in SENSORS}
"""Declarations of all sensors by their attribute in a sampled loop."""
