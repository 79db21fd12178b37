"""`[sampling]`, `[gyro]`, `[star_tracker]`, and sensors of vectors known along the orbit."""

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, PartDeclaration, number
from jaxsat.core.declaration.sensor import (
    GyroFailureKind,
    SensorDeclaration,
    SensorFailureKind,
    boresight,
    drawn,
    measurement_times,
    misalignment,
    outage,
    scale_factor,
    vector_keys,
)
from jaxsat.core.ranges import (
    ATTITUDE_NOISE,
    FROM_ZERO,
    GYRO_BIAS,
    RATE_NOISE,
    RATE_RANGE,
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
    maker="jaxsat.spacecraft.navigation_sensors:Gyro.from_table",
    summary="rate gyros",
    kinds=tuple(GyroFailureKind),
    keys=(
        *drawn(
            "gyro",
            number(
                "noise_density_rad_s_sqrt_Hz",
                "Density of the white noise on each measured rate (angle random walk)",
                within=RATE_NOISE,
                default=0.0,
            ),
            number(
                "bias_walk_rad_s2_sqrt_Hz",
                "Density of the white noise that moves each bias (rate random walk)",
                within=RATE_NOISE,
                default=0.0,
            ),
            number(
                "bias_rad_s",
                "Bias at the start, of all axes or of each",
                within=GYRO_BIAS,
                size=(1, 3),
                default=0.0,
            ),
        ),
        number(
            "bias_sigma_rad_s",
            "Standard deviation of the random part of each bias at the start",
            within=RATE_NOISE,
            default=0.0,
        ),
        *drawn(
            "gyro",
            scale_factor("rate"),
            misalignment("Small rotation of the three input axes, in body axes"),
        ),
        number(
            "limit_rad_s",
            "Largest rate that an axis can measure; by default unlimited",
            within=RATE_RANGE,
            default=None,
        ),
        *drawn("gyro", *outage("gyros", SECONDS)),
    ),
)

STAR_TRACKER = SensorDeclaration(
    name="star_tracker",
    meaning="Star tracker of a sampled law",
    maker="jaxsat.spacecraft.navigation_sensors:StarTracker.from_table",
    summary="star tracker",
    keys=(
        *drawn(
            "tracker",
            number(
                "across_rad",
                "Standard deviation of the measured attitude about each direction across the "
                "boresight",
                within=TRACKER_NOISE,
            ),
            number(
                "along_rad",
                "Standard deviation of the measured attitude about the boresight",
                within=TRACKER_NOISE,
            ),
        ),
        boresight("the boresight"),
        *drawn(
            "tracker",
            *measurement_times(),
            number(
                "rate_limit_rad_s",
                "Largest |ω| at which there are measurements; by default unlimited",
                within=RATE_RANGE,
                default=None,
            ),
            *outage("star tracker"),
        ),
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


def _of_vector(name: str, words: str, vector: str, unit: str = "rad") -> SensorDeclaration:
    """Declare the sensor of a `vector`, the class "module:Class" in the environment."""
    return SensorDeclaration(
        name=name,
        meaning=f"{words[0].upper()}{words[1:]} of a sampled law",
        maker=f"jaxsat.spacecraft.environment.{vector}.from_table",
        summary=words,
        unit=unit,
        keys=vector_keys(unit, words, name),
    )


ATTITUDE_SENSORS: tuple[SensorDeclaration, ...] = (
    STAR_TRACKER,
    _of_vector("magnetometer", "magnetometer", "sensed_vectors:FieldAlongOrbit", "T"),
    _of_vector("sun_sensor", "Sun sensor", "orbital_torques:Sunlight"),
    _of_vector("horizon_sensor", "horizon sensor", "sensed_vectors:Nadir"),
)
"""Intermittent sensors of the attitude; after the first the sensors of vectors."""

SENSORS: tuple[SensorDeclaration, ...] = (GYRO, *ATTITUDE_SENSORS)
"""Sensors with a table of their own, in the order of a scenario."""

OTHER_SENSORS = "sensor"
"""Tables `[sensor.NAME]` of sensors that do not come with jaxsat."""

FAILING: dict[str, tuple[AbstractFailureKind, ...]] = {
    **{one.name: one.kinds for one in SENSORS},
    OTHER_SENSORS: tuple(SensorFailureKind),
}
"""Kinds of failure of each sensor, by the first word of its name in `[[failure]]`."""

SAMPLING = "sampling"
"""Table of the white noise that stands in for sensors."""

SENSED: dict[str, PartDeclaration] = {SAMPLING: WHITE_NOISE} | {one.name: one for one in SENSORS}
"""Declarations of all that a sampled law measures with, by the name of the table."""
