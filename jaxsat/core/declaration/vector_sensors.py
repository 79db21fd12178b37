"""`[magnetometer]`, `[sun_sensor]`, `[horizon_sensor]`: sensors of vectors known in orbit."""

from jaxsat.core.declaration.keys import Key, number
from jaxsat.core.declaration.sensor import SensorDeclaration
from jaxsat.core.ranges import (
    FIELD_BIAS,
    FIELD_NOISE,
    FROM_ZERO,
    HALF_ANGLE,
    MISALIGNMENT,
    SCALE_FACTOR,
    SECONDS,
    TRACKER_NOISE,
)


def _common_keys(name: str, noise: Key) -> tuple[Key, ...]:
    """What all have: noise, misalignment, times of measurements, and an outage."""
    called = name.replace("_", " ")
    return (
        noise,
        number(
            "misalignment_rad",
            "Small rotation of the measured vector, in body axes",
            "rad",
            within=MISALIGNMENT,
            size=3,
            default=(0.0, 0.0, 0.0),
            drawn=f"{name}_misalignment",
        ),
        number(
            "update_period_s",
            "Time between measurements, a whole multiple of control.period_s, which it is by "
            "default",
            "s",
            within=SECONDS,
            default=None,
        ),
        number(
            "latency_s",
            "Time from a measurement to its arrival, a whole multiple of control.period_s, or "
            "zero; measurements of faster sensors wait for the slowest",
            "s",
            within=FROM_ZERO,
            default=0.0,
        ),
        number(
            "outage_start_s",
            "Time at which an outage begins, in which nothing is measured; by default none",
            "s",
            within=FROM_ZERO,
            default=None,
            drawn=f"{name}_outage_start",
        ),
        number(
            "outage_s",
            f"Length of the outage of the {called}",
            "s",
            within=FROM_ZERO,
            default=None,
            drawn=f"{name}_outage",
        ),
    )


def _direction_keys(name: str) -> tuple[Key, ...]:
    """What sensors of a direction have: noise across it, and a field of view."""
    noise = number(
        "noise_rad",
        "Standard deviation of the measured direction about each axis across it",
        "rad",
        within=TRACKER_NOISE,
        drawn=f"{name}_noise",
    )
    return (
        *_common_keys(name, noise),
        number(
            "boresight",
            "Direction of the middle of the field of view in body axes",
            "1",
            at_least=-1e6,
            at_most=1e6,
            size=3,
            default=(0.0, 0.0, 1.0),
        ),
        number(
            "half_angle_rad",
            "Half of the angle of the conical field of view; by default everything is in view",
            "rad",
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
    keys=(
        *_common_keys(
            "magnetometer",
            number(
                "noise_T",
                "Standard deviation of white noise on each component of the measured field",
                "T",
                within=FIELD_NOISE,
                drawn="magnetometer_noise",
            ),
        ),
        number(
            "bias_T",
            "Error of the measured field that is fixed in body axes, of all or of each",
            "T",
            within=FIELD_BIAS,
            size=3,
            or_one=True,
            default=0.0,
            drawn="magnetometer_bias",
        ),
        number(
            "scale_factor",
            "Relative error of the measured field, of all axes or of each",
            "1",
            within=SCALE_FACTOR,
            size=3,
            or_one=True,
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
    keys=_direction_keys("sun_sensor"),
)

HORIZON_SENSOR = SensorDeclaration(
    name="horizon_sensor",
    meaning="Horizon sensor of a sampled law",
    place="navigation.horizon_sensor",
    maker="jaxsat.spacecraft.vector_sensors:horizon_sensor",
    summary="horizon sensor",
    keys=_direction_keys("horizon_sensor"),
)

VECTOR_SENSORS: tuple[SensorDeclaration, ...] = (MAGNETOMETER, SUN_SENSOR, HORIZON_SENSOR)
"""The sensors of a vector, in the order of a scenario."""
